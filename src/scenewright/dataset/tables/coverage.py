"""What scenes cover: bins and crosses of what was asked for and what the checker measured."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import pairwise, product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

import numpy as np
from pydantic import Field, ValidationError, model_validator

from scenewright.geometry.kinematics import differentiate
from scenewright.scene.base import AgentClass, FieldError, Model, Movement
from scenewright.scene.events import EventType
from scenewright.scene.kinds import list_names
from scenewright.scene.plan_file import PlanFault, describe_faults, read_yaml
from scenewright.scene.social import Density
from scenewright.scene.spread import read_number

Encounter = dict[str, Any]
"""What one event shows: item -> its value; None where it has none."""
ITEMS: Mapping[str, Mapping[str, Any]] = tomllib.loads(
    resources.files(__package__).joinpath("items.toml").read_text("utf-8")
)
if TYPE_CHECKING:
    Item = str
else:
    Item = Literal[tuple(ITEMS)]
NUMBERS = {
    name: (item["unit"], tuple(item["edges"])) for name, item in ITEMS.items() if "unit" in item
}
"""Items that are numbers: unit, and edges of the usual bins."""
_KEYS = {name: item["key"] for name, item in ITEMS.items() if "key" in item}


def list_words(item: str) -> tuple[str, ...]:
    """All that an item in words may be; nothing where that is the place's business."""
    classes, who = get_args(AgentClass), ("from and to", "from", "to", "neither")
    words: dict[str, tuple[str, ...]] = {
        "event": (*get_args(EventType), "normal"), "kind": list_names("collision"),
        "cause": (*list_names("cause"), "none seen"), "asked": ("asked", "unasked"),
        "avoidable": who, "ran_red": who, "caused_by": classes, "type": classes,
        "subtype": list_names("subtype"), "movement": get_args(Movement),
        "density": (*get_args(Density), "as usual"),
    }  # fmt: skip
    return words.get(item.removesuffix("_from").removesuffix("_to"), ())


class Cover(Model):
    """One item: its bins, and how often each is wanted."""

    cover: Item
    bins: tuple[float, ...] | None = Field(default=None, min_length=2)
    values: tuple[str, ...] = ()
    least: int = Field(default=1, ge=0)

    @model_validator(mode="before")
    @classmethod
    def _convert_units(cls, data: Any) -> Any:
        if not isinstance(data, dict) or not isinstance(bins := data.get("bins"), list):
            return data
        unit, _ = NUMBERS.get(str(data.get("cover")), ("", ()))
        found = []
        for n, edge in enumerate(bins):
            try:
                found.append(read_number(edge, None if unit == "h" else unit or None))
            except ValueError as error:
                raise FieldError(str(error), "bins", n) from error
        return data | {"bins": found}

    @model_validator(mode="after")
    def _check_bins(self) -> Self:
        is_number, words = self.cover in NUMBERS, list_words(self.cover)
        if self.values if is_number else self.bins:
            what = "a number; write bins" if is_number else "in words; write values"
            raise FieldError(f"{self.cover} is {what}", "values" if is_number else "bins")
        for n, value in enumerate(self.values):
            if words and value not in words:
                raise FieldError(f"must be {', '.join(words)}, not {value!r}", "values", n)
        if any(a >= b for a, b in pairwise(self.bins or ())):
            raise FieldError("edges of bins rise", "bins")
        return self


class Cross(Model):
    """Items whose bins are wanted in every combination."""

    cross: tuple[Item, ...] = Field(min_length=2, max_length=4)
    least: int = Field(default=1, ge=1)


class Goals(Model):
    """What a dataset is to cover."""

    dimensions: tuple[Cover, ...] = ()
    crosses: tuple[Cross, ...] = ()


def read_goals(source: Path | dict[str, Any]) -> Goals:
    """The goals in a file, or in a mapping.

    Raises:
        InputError: unreadable, or no goals; names the line and the field.
    """
    name = str(source) if isinstance(source, Path) else "goals"
    data, lines = read_yaml(source) if isinstance(source, Path) else (source, {})
    try:
        goals = Goals.model_validate(data)
    except ValidationError as error:
        raise PlanFault(name, lines, describe_faults(error, lines, Goals)) from error
    if not goals.dimensions and not goals.crosses:
        raise PlanFault(name, lines, {(): "holds no goals; write dimensions or crosses"})
    return goals


def list_encounters(scene: Mapping[str, Any], proof: Mapping[str, Any]) -> list[Encounter]:
    """What each event of a scene shows, as asked for or measured; `normal` where there is none.

    Speeds that are no evidence of the event are those at the conflict: where the agent comes
    nearest to the place of the PET, else at the event's time. Beside the items stand `time`,
    `pet_time`, `ttc_time` [s], and the `worst_ttc` of the scene with its time.
    """
    agents = {agent["id"]: agent for agent in scene["agents"]}
    meta, figures, found = scene["meta"], proof["figures"], []
    red = {run["agent"] for run in figures.get("red_light_runs", ())}
    same = {"junction": meta["intersection"], "hour": meta["timestamp"] / 3600,
            "density": meta["density"] or "as usual", "agents": len(agents)}  # fmt: skip
    for event in proof["events"]:
        sides = {"from": event["from"], "to": event["to"]}
        pair, type_ = set(sides.values()), event["type"]
        asked = [
            r for r in scene["relations"] if r["type"] == type_ and {r["from"], r["to"]} == pair
        ]
        known = (asked[0] if asked else {}) | event | event["evidence"]
        own = {item: known.get(key) for item, key in _KEYS.items()} | {"time": event["time"]}
        when, worst = (event.get(key, {}) for key in ("when", "worst"))
        pet, ttc, least = when.get("pet"), when.get("path_ttc"), worst.get("path_ttc")
        own |= {
            f"{name}_time": moment and moment["time"]
            for name, moment in (("pet", pet), ("ttc", ttc), ("worst_ttc", least))
        }
        own["worst_ttc"] = least and least["value"]
        own |= {"event": type_, "cause": event["cause"] or "none seen",
                "asked": "asked" if asked else "unasked",
                "caused_by": agents.get(known.get("cause_agent"), {}).get("type")}  # fmt: skip
        could = {each["agent"]: each["avoidable"] for each in figures.get("avoidability", ())
                 if {each["agent"], each["other"]} == pair and each["event"] == type_}  # fmt: skip
        runs = [side for side, number in sides.items() if number in red]
        own["ran_red"] = " and ".join(runs) or "neither"
        if could:
            able = [side for side, number in sides.items() if could.get(number)]
            own["avoidable"] = " and ".join(able) or "neither"
        for side, number in sides.items():
            agent = agents[number]
            for key in ("type", "subtype", "movement", "entry"):
                own[f"{key}_{side}"] = agent[key]
            own["crosswalk"] = agent["crosswalk"] or own.get("crosswalk")
            track = np.array(agent["trajectory"], dtype=np.float64)
            at = round((event["time"] - agent["spawn_time"]) / meta["step"])
            at = min(max(at, 0), len(track) - 1)
            if pet is not None:
                at = int(np.hypot(*(track - pet["location"]).T).argmin())
            speed = np.hypot(*differentiate(track, meta["step"])[at])
            own[f"speed_{side}"] = known.get(f"speed_{side}", float(speed))
        found.append(same | own)
    return found or [same | {"event": "normal"}]


@dataclass(frozen=True)
class Bins:
    """The bins of an item: between rising edges, the last one closed, or words."""

    item: str
    labels: tuple[str, ...]
    edges: tuple[float, ...] = ()

    def find(self, value: Any) -> str | None:
        """The bin of a value; of a word that is not among them, itself."""
        if value is None or not self.edges:
            return None if value is None else str(value)
        n = int(np.searchsorted(self.edges, value, side="right")) - 1
        n -= value == self.edges[-1]
        return self.labels[n] if 0 <= n < len(self.labels) else None


def build_bins(item: str, edges: Sequence[float] = (), words: Sequence[str] = ()) -> Bins:
    """The bins of an item as named, else the usual ones."""
    if item not in NUMBERS and not edges:
        return Bins(item, tuple(words) or list_words(item))
    unit, usual = NUMBERS.get(item, ("", ()))
    edges = tuple(edges or usual)
    labels = tuple(f"{a:.4g} to {b:.4g} {unit}".strip() for a, b in pairwise(edges))
    return Bins(item, labels, edges)


@dataclass(frozen=True)
class Covered:
    """How often each bin of an item, or of a cross of items, is met.

    Attributes:
        counts: bin -> encounters; the first `wanted` of them each want `least`.
        values: encounters that have a value of each item; shut: bins that are not feasible.
    """

    items: tuple[str, ...]
    least: int
    counts: Mapping[tuple[str, ...], int]
    wanted: int
    values: int
    shut: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Such as `pet` or `event x hour`."""
        return " x ".join(self.items)

    @property
    def gaps(self) -> dict[tuple[str, ...], int]:
        """Bin -> how many encounters it lacks."""
        wanted = list(self.counts.items())[: self.wanted]
        return {bin_: self.least - n for bin_, n in wanted if n < self.least}

    def describe_gap(self, bin_: tuple[str, ...]) -> str:
        """Such as "event near_miss and hour 6 to 9 h: 1 of 3 wanted"."""
        named = " and ".join(map(" ".join, zip(self.items, bin_, strict=True)))
        return f"{named}: {self.counts[bin_] or 'none'} of {self.least} wanted"


def count_bins(encounters: Sequence[Encounter], bins: Sequence[Bins], least: int = 1) -> Covered:
    """How often each combination of bins is met."""
    own = [[encounter.get(b.item) for b in bins] for encounter in encounters]
    found = ([b.find(v) for b, v in zip(bins, values, strict=True)] for values in own)
    seen = Counter(tuple(map(str, bin_)) for bin_ in found if None not in bin_)
    # Of an item whose words are the place's business, those that are seen are wanted.
    words = [b.labels or sorted({bin_[n] for bin_ in seen}) for n, b in enumerate(bins)]
    wanted = list(product(*words))
    counts = {bin_: seen.pop(bin_, 0) for bin_ in wanted} | dict(sorted(seen.items()))
    values = sum(None not in each for each in own)
    return Covered(tuple(b.item for b in bins), least, counts, len(wanted), values)


def measure_coverage(encounters: Sequence[Encounter], goals: Goals | None = None) -> list[Covered]:
    """What is covered of each goal, or of every item that any encounter has."""
    if goals is None:
        found = (count_bins(encounters, [build_bins(item)]) for item in ITEMS)
        return [each for each in found if each.values]
    bins = {dimension.cover: build_bins(dimension.cover, dimension.bins or (), dimension.values)
            for dimension in goals.dimensions}  # fmt: skip
    covered = [count_bins(encounters, [bins[dimension.cover]], dimension.least)
               for dimension in goals.dimensions if dimension.least]  # fmt: skip
    for cross in goals.crosses:
        own = [bins.get(item) or build_bins(item) for item in cross.cross]
        covered.append(count_bins(encounters, own, cross.least))
    return covered
