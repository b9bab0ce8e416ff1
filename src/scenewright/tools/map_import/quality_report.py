"""What an import read, derived, assumed and dropped, item by item, with a score for each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from scenewright.tools.map_import.ground_areas import CrosswalkPlacement
from scenewright.tools.map_import.mapped_crosswalks import CrossingChoice, MappedCrosswalk
from scenewright.tools.map_import.survey import LEARNED, ReportItem, SurveyCrossing

_NEAR = 60.0
"""Crossings of the file within that distance of a leg's are worth a word [m]."""


@dataclass(frozen=True)
class CrosswalkFact:
    """Where the crosswalk of one leg comes from.

    Attributes:
        leg: its name; origin: `file`, `learned` of people's tracks, `derived` or `none`.
        offset: from the file's to ours [m]: of areas from middle to middle; of nodes of a road,
            which say where it is crossed and not where its kerbs are, to our crosswalk's middle
            line. None if the file holds none.
        centre_offset: from the middle of what the file holds to ours, however drawn [m].
        sources: what the file calls it, one for each stage; middle: ours [m].
        drawn: [stages, 2] middles of the file's [m].
        nearest: for a derived one, the file's nearest crossing [m]; None if there is none.
        left_out: crossings of the file on this leg that are not on the map, and why.
    """

    leg: str
    origin: str
    offset: float | None
    centre_offset: float | None
    sources: tuple[str, ...]
    middle: tuple[float, float] | None
    drawn: tuple[tuple[float, float], ...]
    nearest: float | None
    left_out: tuple[str, ...]


def describe_crosswalk(
    leg: str,
    placed: CrosswalkPlacement | None,
    choice: CrossingChoice,
    k: int,
    crossings: Sequence[SurveyCrossing],
    refused: str,
) -> CrosswalkFact:
    """The account of the crosswalk of leg number k; refused: why it is not the file's."""
    mapped = choice.by_leg.get(k)
    left_out = [f"{x.source} {why}" for x, where, why in choice.left_out if where == k]
    used = None if placed is None else placed.mapped
    if mapped is not None and used is None:
        left_out += [f"{source} {refused}" for source in mapped.sources]
    middle = (
        None if placed is None else (round_metre(placed.middle[0]), round_metre(placed.middle[1]))
    )
    offset = centre_offset = nearest = None
    if placed is not None and used is not None:
        centre_offset = round_metre(float(np.hypot(*(placed.middle - used.middle))))
        offset = centre_offset if used.is_bounded else _measure_offset(placed, used)
    elif placed is not None and crossings:
        away = (float(np.hypot(*(x.line.mean(axis=0) - placed.middle))) for x in crossings)
        nearest = round_metre(min(away))
    origin = "none" if placed is None else "derived"
    if used is not None:
        learned = all(source.startswith(LEARNED) for source in used.sources)
        origin = "learned" if learned else "file"
    return CrosswalkFact(
        leg=leg,
        origin=origin,
        offset=offset,
        centre_offset=centre_offset,
        sources=() if used is None else used.sources,
        middle=middle,
        drawn=tuple(
            (round_metre(x.middle[0]), round_metre(x.middle[1]))
            for x in (() if used is None else used.stages)
        ),
        nearest=nearest,
        left_out=tuple(left_out),
    )


def _measure_offset(placed: CrosswalkPlacement, mapped: MappedCrosswalk) -> float:
    """From the farthest of the file's stages to the middle line of our crosswalk [m]."""
    start, end = placed.ends
    along = (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    away = []
    for stage in mapped.stages:
        reach = float(np.clip((stage.middle - start) @ along, 0.0, np.hypot(*(end - start))))
        away.append(float(np.hypot(*(stage.middle - start - reach * along))))
    return round_metre(max(away))


def round_metre(value: float) -> float:
    """To the centimetre, without a negative zero."""
    return round(float(value), 2) + 0.0


def list_crosswalk_notes(facts: Sequence[CrosswalkFact]) -> Iterator[str]:
    """What is said of the crosswalks at import, one fact a line."""
    if read := [fact for fact in facts if fact.origin == "file"]:
        off = max(fact.offset or 0.0 for fact in read)
        yield (
            f"crosswalks of the file: {', '.join(fact.leg for fact in read)}; their middles are at "
            f"most {off:.1f} m from the file's"
        )
    for fact in facts:
        if fact.origin == "learned":
            yield f"crosswalk on {fact.leg} {fact.sources[0]}"
    reasons: dict[str, list[str]] = {}
    for fact in facts:
        if fact.origin == "derived":
            why = f"no crossing was found in the file within {_NEAR:.0f} m"
            if fact.left_out:
                why = "what the file draws there does not fit"
            elif fact.nearest is not None and fact.nearest <= _NEAR:
                why = f"the file's nearest crossing, {fact.nearest:.0f} m away, is not on this leg"
            reasons.setdefault(why, []).append(fact.leg)
    for reason, legs in reasons.items():
        yield f"crosswalk derived on {', '.join(legs)}, 4 m wide, where the leg is narrow: {reason}"
    for fact in facts:
        yield from (f"crossing not on the map, {fact.leg}: {line}" for line in fact.left_out)


_CLOSE = 1.5
"""A crosswalk whose middle is that close to the file's lies where the file has it [m]."""


def rate_crosswalks(facts: Sequence[CrosswalkFact]) -> ReportItem:
    """As drawn counts fully, far from its place or with pieces left out half, lost not at all."""
    read = [fact for fact in facts if fact.origin == "file"]
    lost = [f for f in facts if f.origin in ("derived", "none") and f.left_out]
    known = [0.0 for _ in lost]
    for fact in read:
        whole = all("twice" in line for line in fact.left_out)
        known.append(1.0 if whole and (fact.offset or 0.0) <= _CLOSE else 0.5)
    if not known:
        return ReportItem("crosswalks", "derived", None, "the file draws none on these legs")
    exact = sum(fact.offset is not None and fact.offset <= _CLOSE for fact in read)
    detail = f"{exact} of {len(read)} within {_CLOSE} m of the file's"
    detail += f", {len(lost)} of the file's lost" if lost else ""
    others = len(facts) - len(read) - len(lost)
    detail += f", {others} derived" if others else ""
    state = "read" if len(read) == len(facts) else "partly read" if read else "derived"
    return ReportItem("crosswalks", state, round(sum(known) / len(known), 3), detail)


def build_report(
    items: Sequence[ReportItem], crosswalks: Sequence[CrosswalkFact], notes: Sequence[str]
) -> Mapping[str, Any]:
    """The report as it is written to a bundle."""
    known = [item.score for item in items if item.score is not None]
    return {
        "score": round(sum(known) / len(known), 3) if known else None,
        "items": [asdict(item) for item in items],
        "crosswalks": [asdict(fact) for fact in crosswalks],
        "notes": list(notes),
    }


def format_report(report: Mapping[str, Any]) -> str:
    """The report in one line."""
    parts = [
        f"{item['item']} {item['state']}"
        + ("" if item["score"] is None else f" ({item['score']:.2f})")
        for item in report["items"]
    ]
    score = "" if report["score"] is None else f", {report['score']:.2f} of what the file says"
    return f"as in the file: {'; '.join(parts)}{score}"
