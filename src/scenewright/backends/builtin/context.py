"""Density, time of day and explicit background numbers (SEMANTICS section 3)."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.backends.builtin.clock import Clock, read_time_words
from scenewright.backends.builtin.draft import ContextDraft, Draft, Refused
from scenewright.backends.builtin.lexicon import Chunk

_BUSIER = {None: "high", "low": "medium", "medium": "high", "high": "high"}
_QUIETER = {None: "low", "low": "low", "medium": "low", "high": "medium"}
_NOT_TRAFFIC = frozenset({"fog", "rain", "snow", "mist", "cloud", "storm", "sidewalk"})


def read_context(draft: Draft, chunks: Sequence[Chunk], clock: Clock) -> None:
    """Fill the draft's context from the chunks and the figures of the text."""
    context = draft.context
    words = [chunk.tags["TIMEWORD"] for chunk in chunks if chunk.has("TIMEWORD")]
    time = read_time_words(_keep_specific(words), clock=clock.time)
    context.time_of_day = time or context.time_of_day
    context.density = _find_density(chunks, context) or context.density
    context.pet, context.ttc, context.speed = clock.pet, clock.ttc, clock.speed
    if any(chunk.has("NOBODY") for chunk in chunks):
        context.vehicles, context.pedestrians = 0, 0
    if draft.relations and context.density is None and _has_plain_traffic(chunks):
        context.density = "medium"


def _keep_specific(words: list[str]) -> list[str]:
    """ "rush hour ... in the morning" is the morning rush."""
    if "rush hour" in words and "morning" in words:
        return ["morning rush"]
    if "rush hour" in words and {"evening", "afternoon"} & set(words):
        return ["evening rush"]
    return words


def _find_density(chunks: Sequence[Chunk], context: ContextDraft) -> str | None:
    found: list[str] = []
    for at, chunk in enumerate(chunks):
        after = chunks[at + 1] if at + 1 < len(chunks) else None
        if chunk.has("BUSIER"):
            table = _BUSIER if chunk.tags["BUSIER"] == "up" else _QUIETER
            found.append(table[context.density])
        elif chunk.has("DENSITY") and not _describes_else(after):
            found.append(_negate_density(chunk.tags["DENSITY"], chunks, at))
        elif chunk.has("LEVEL") and _is_near_traffic(chunks, at):
            found.append(chunk.tags["LEVEL"])
        elif chunk.text == "normal" and _is_near_density(chunks, at):
            found.append("medium")
    if {"high", "low"} <= set(found):
        raise Refused("contradictory", "The traffic cannot be both busy and quiet; keep one.")
    return found[0] if found else None


def _negate_density(value: str, chunks: Sequence[Chunk], at: int) -> str:
    before = chunks[at - 1] if at else None
    if before is not None and before.has("NEGATION"):
        return {"high": "low", "low": "high", "medium": "medium"}[value]
    return value


def _describes_else(after: Chunk | None) -> bool:
    """A crowded bus and dense fog say nothing of the traffic."""
    if after is None:
        return False
    vehicle = (
        after.has("AGENT")
        and after.tags["AGENT"].startswith("vehicle.")
        and not after.text.endswith("s")
    )
    return vehicle or bool(_NOT_TRAFFIC & set(after.words))


def _is_near_traffic(chunks: Sequence[Chunk], at: int) -> bool:
    for step in (1, 2, 3):
        item = chunks[at + step] if at + step < len(chunks) else None
        if item is None or item.mark:
            break
        if _is_traffic(item):
            return True
        if item.has("SIGNAL", "DET") or (
            item.has("AGENT") and item.text not in {"pedestrian", "vehicle", "car"}
        ):
            break
    for back in (1, 2, 3):
        item = chunks[at - back] if at - back >= 0 else None
        if item is None or item.mark in {".", ",", ";"}:
            break
        if _is_traffic(item):
            return True
        if item.has("AGENT") or not (item.has("BE", "COLON") or not item.tags):
            break
    return False


def _is_near_density(chunks: Sequence[Chunk], at: int) -> bool:
    near = chunks[max(0, at - 3) : at + 3]
    return any(chunk.has("TRAFFIC_NOUN") for chunk in near)


def _is_traffic(chunk: Chunk) -> bool:
    return chunk.has("TRAFFIC_NOUN") or chunk.tags.get("AGENT") == "traffic"


def _has_plain_traffic(chunks: Sequence[Chunk]) -> bool:
    return any(
        chunk.has("NORMAL") and ("traffic" in chunk.words or chunk.text == "normal flow")
        for chunk in chunks
    )
