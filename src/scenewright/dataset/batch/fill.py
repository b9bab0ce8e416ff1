"""Rows of a batch that ask for what a dataset does not cover."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import count
from typing import Any

from scenewright.dataset.tables.coverage import ITEMS, Covered, Encounter
from scenewright.errors import InputError
from scenewright.scene.events import RELATION_OF_EVENT
from scenewright.scene.measures import UNITS
from scenewright.scene.plan_file import read_plan
from scenewright.scene.social import RelationEdge

_ASKED = {name: (item["event"], item["field"]) for name, item in ITEMS.items() if "event" in item}
"""Numbers that can be asked for: at which event, and the field of the relation, for the middle of
the bin, or the figure, within the bin."""


def build_fill(
    covered: Sequence[Covered], encounters: Sequence[Encounter], *, taken: Collection[str] = ()
) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows for `scenewright batch` that ask for what is missing, and what cannot be asked for.

    Crosses come first; what their rows bring along is not asked for again.

    Args:
        taken: ids of rows that no row may have, so that its scene can join theirs.
    """
    ids = (name for k in count(1) if (name := f"fill-{k:04d}") not in taken)
    rows: list[dict[str, Any]] = []
    brought: list[dict[str, str]] = []
    left: list[str] = []
    for each in sorted(covered, key=lambda each: -len(each.items)):
        for bin_, missing in each.gaps.items():
            wanted = dict(zip(each.items, bin_, strict=True))
            try:
                row = _build_row(wanted, encounters)
            except InputError as error:
                left.append(f"{each.describe_gap(bin_)}; {error}")
                continue
            for _ in range(missing - sum(wanted.items() <= own.items() for own in brought)):
                rows.append({"id": next(ids), **row})
                brought.append(wanted)
    return rows, left


def _build_row(wanted: Mapping[str, str], encounters: Sequence[Encounter]) -> dict[str, Any]:
    """A row that asks for bins of items.

    Raises:
        InputError: they cannot be asked for.
    """
    if never := [item for item in wanted if ITEMS[item].get("comes")]:
        raise InputError(f"{', '.join(never)} cannot be asked for")
    context: dict[str, Any] = {}
    if "hour" in wanted:
        low, high = (60 * edge for edge in _read_bin(wanted["hour"]))
        clock = [f"{int(m // 60):02d}:{int(m % 60):02d}" for m in (low, high - 1)]
        context["time_of_day"] = "-".join(clock)
    if wanted.get("density", "as usual") != "as usual":
        context["density"] = wanted["density"]
    plan: dict[str, Any] = {"agents": [], "context": context}
    events = {_ASKED[item][0] for item in wanted if item in _ASKED}
    events |= {"collision"} if "kind" in wanted else set()
    events |= {wanted["event"]} if "event" in wanted else set()
    usual = Counter(
        str(encounter["event"]) for encounter in encounters if encounter["event"] != "normal"
    )
    event = str(next(iter(sorted(events) or usual), "near_miss"))
    if len(events) > 1 or (event == "normal" and wanted.keys() - {"event", "hour", "density"}):
        raise InputError(f"no {wanted.get('event', event)} can be asked for that has all of it")
    if event != "normal":
        _add_encounter(plan, event, wanted, encounters)
    read_plan(plan)
    place = {"overrides": {"intersection": wanted["junction"]}} if "junction" in wanted else {}
    return {"plan": plan, **place}


def _add_encounter(
    plan: dict[str, Any], event: str, wanted: Mapping[str, str], encounters: Sequence[Encounter]
) -> None:
    """Puts two agents, their relation and its figures into a plan.

    Types that are not wanted are those of most encounters of the kind.
    """
    needed = {}
    for side in ("from", "to"):
        if f"subtype_{side}" in wanted:
            needed[f"type_{side}"] = "vehicle"
        if (movement := wanted.get(f"movement_{side}")) is not None:
            afoot = movement in ("crossing", "jaywalking")
            needed[f"type_{side}"] = "pedestrian" if afoot else "vehicle"
    if "crosswalk" in wanted:
        needed["type_to"] = "pedestrian"
    kept = ("event", "kind", "type_from", "type_to")
    needed |= {key: value for key, value in wanted.items() if key in kept}
    pairs = Counter((encounter["type_from"], encounter["type_to"]) for encounter in encounters
                    if {"event": event, **needed}.items() <= encounter.items())  # fmt: skip
    follows = event == "follow" or wanted.get("kind") in ("rear_end", "sideswipe", "head_on")
    other = "pedestrian" if not follows and needed.get("type_from") != "pedestrian" else "vehicle"
    first, second = max(pairs, key=lambda pair: pairs[pair], default=("vehicle", other))
    types = (needed.get("type_from", first), needed.get("type_to", second))
    names = [f"{types[0]}-1", f"{types[1]}-{1 + (types[0] == types[1])}"]
    relation: dict[str, Any] = {"type": RELATION_OF_EVENT[event], "from": names[0], "to": names[1]}
    known = {key: value for key, value in wanted.items() if value != "none seen"}
    relation |= {key: known[key] for key in ("kind", "cause") if key in known}
    measures = []
    for item in (each for each in wanted if each in _ASKED):
        (low, high), field = _read_bin(wanted[item]), _ASKED[item][1]
        if field in RelationEdge.model_fields:
            relation[field] = (low + high) / 2
            continue
        one, other = names[::-1] if item == "speed_to" else names
        measures.append({"kind": field, "agent": one, "other": other, "low": low, "high": high})
        if not UNITS[field].least <= (low + high) / 2 <= UNITS[field].most:
            raise InputError(f"no {item} of a scene is so")
    for side, name in zip(("from", "to"), names, strict=True):
        own = {key: wanted.get(f"{key}_{side}") for key in ("subtype", "movement", "entry")}
        own["crosswalk"] = wanted.get("crosswalk") if side == "to" else None
        runs_red = {"runs_red": True} if side in wanted.get("ran_red", "").split() else {}
        plan["agents"].append({"id": name, **{k: v for k, v in own.items() if v}, **runs_red})
    plan |= {"relations": [relation], "measures": measures}


def _read_bin(label: str) -> tuple[float, float]:
    """The edges of a bin such as "0.5 to 1 s"."""
    low, _, high, *_ = label.split()
    return float(low), float(high)
