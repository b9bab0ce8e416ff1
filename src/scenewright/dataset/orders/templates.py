"""Text templates in many styles: a headline, a report, a request, small talk, shorthand.

A voice is a template for whole texts; its nouns and phrases are drawn from word lists. What a
voice makes of a story is read back before it is used, so a wording that is misread costs nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from scenewright.dataset.orders.order_spec import WORDS
from scenewright.dataset.orders.scenario_spec import Party, Story, has_likelier_twin
from scenewright.scene.base import AgentClass
from scenewright.scene.relations import get_pattern

ItemT = TypeVar("ItemT")

_NOUNS: Mapping[AgentClass, Mapping[str, float]] = WORDS["nouns"]
_RUNS: Mapping[AgentClass, list[str]] = WORDS["runs"]
_SURELY_ON_FOOT = ("pedestrian", "jogger")
"""Nouns of one that hits another pedestrian; a man or a woman that does might be driving."""


class Verb(NamedTuple):
    """Present, past, after `to`, and passive where there is one: `{0}` acts on `{1}`."""

    present: str
    past: str
    bare: str
    passive: str | None = None


VOICES: Mapping[str, str] = WORDS["voices"]


def list_voices(story: Story) -> list[str]:
    """Names of the templates that fit a story."""
    if story.leaf is None:
        names = ("plain", "setting first", "request", "telegraph", "headline", "report", "list")
        return [name for name in names if _has_all(VOICES[name], story)]
    if has_likelier_twin(get_pattern(story.leaf)):
        return ["phrase"]
    fitting = [name for name in VOICES if _has_all(VOICES[name], story)]
    return [name for name in fitting if name != "two looks" or story.parties[1].tie is None]


def _has_all(text: str, story: Story) -> bool:
    needs_clock = any(part in text for part in ("{clock}", "{Clock}", "{At}"))
    needs_density = any(part in text for part in ("{Density}", "{level}"))
    return not (needs_clock and story.clock is None) and not (
        needs_density and story.density is None
    )


def render_text(story: Story, voice: str, rng: np.random.Generator) -> str:
    """The story as text in that voice."""
    parts: dict[str, str] = {}
    if story.leaf is None:
        event = _draw_one(WORDS["normal"]["nobody"], rng)
        if story.parties:
            event = _draw_one(WORDS["normal"]["passing"], rng).format(*_draw_nouns(story, rng)[1])
        event = past = event[0].lower() + event[1:]
        parts |= _render_setting(story, rng)
    else:
        pattern = get_pattern(story.leaf)
        names, nouns = _draw_nouns(story, rng)
        verb = _draw_one([Verb(*each) for each in pattern.find_kind("verbs").verbs], rng)
        event = f"{nouns[0]} {verb.present} {nouns[1]}"
        past = f"{nouns[0]} {verb.past} {nouns[1]}"
        passive = f"{nouns[1]} is {verb.passive} {nouns[0]}" if verb.passive else event
        parts |= _render_setting(story, rng)
        own = _draw_one(pattern.phrases, rng)
        parts |= {
            "Passive": _capitalize(passive), "verb": verb.present,
            "first": nouns[0], "First": _capitalize(nouns[0]), "second": nouns[1],
            "second again": f"the {names[1]}",
            "Own": _capitalize(own.replace("{from}", nouns[0]).replace("{to}", nouns[1])),
        }  # fmt: skip
    parts |= {
        "event": event, "Event": _capitalize(event), "EVENT": event.upper(),
        "Past": _capitalize(past),
    }  # fmt: skip
    text = VOICES[voice]
    for name, words in parts.items():
        text = text.replace("{" + name + "}", words)
    return " ".join(text.replace(" .", ".").replace("..", ".").replace(" ,", ",").split())


def _draw_nouns(story: Story, rng: np.random.Generator) -> tuple[list[str], list[str]]:
    """A noun for each party, different ones, and all that is said of it."""
    names = [_draw_weighted(_NOUNS[party.type], rng) for party in story.parties]
    if story.leaf and {party.type for party in story.parties} == {"pedestrian"}:
        names[0] = _draw_one(_SURELY_ON_FOOT, rng)
    if story.parties[0].type == story.parties[1].type:
        others = {n: w for n, w in _NOUNS[story.parties[1].type].items() if n != names[0]}
        names[1] = _draw_weighted(others, rng)
    pairs = zip(story.parties, names, strict=True)
    nouns = [_render_party(party, name, rng) for party, name in pairs]
    if story.runner is not None:
        nouns[story.runner] += f" {_draw_one(_RUNS[story.parties[story.runner].type], rng)}"
    return names, nouns


def _render_setting(story: Story, rng: np.random.Generator) -> dict[str, str]:
    """Words for time and density, empty where they are not given."""
    clock = "" if story.minute is None else _format_clock(story.minute, rng)
    density = "" if story.density is None else _draw_one(WORDS["densities"][story.density], rng)
    within = f" {_draw_one(('in', 'with'), rng)} {density}" if density else ""
    at = f" at {clock}" if clock else ""
    return {
        "at": at, "At": f"At {clock}", "AT": at.upper(),
        "clock": clock, "Clock": _capitalize(clock),
        "in": within, "IN": within.upper(),
        "with": f" and there was {density}" if density else "",
        "Density": _capitalize(density), "level": story.density or "",
    }  # fmt: skip


def _format_clock(minute: int, rng: np.random.Generator) -> str:
    hour, rest = divmod(minute, 60)
    half = "am" if hour < 12 else "pm"
    twelve = (hour - 1) % 12 + 1
    ways = [f"{hour:02d}:{rest:02d}", f"{twelve}:{rest:02d} {half}"]
    if rest == 0:
        ways.append(f"{twelve} {half}")
        ways += [f"{twelve} o'clock in the morning"] if 1 <= hour < 12 else []
    if rest == 30:
        ways.append(f"half past {twelve} {half}")
    return _draw_one(ways, rng)


def _render_party(party: Party, name: str, rng: np.random.Generator) -> str:
    """`a left-turning taxi from the north`, `a woman on the east crosswalk`."""
    if party.movement in ("crossing", "jaywalking"):
        return _render_walking(party, name, rng)
    turns = {"left": ("left-turning", "turning left"), "right": ("right-turning", "turning right")}
    if party.movement in turns:
        before, after = turns[party.movement]
        front = party.side is None and party.tie is None and rng.random() < 0.5
        words = f"{before} {name}" if front else f"{name} {after}"
    elif party.movement == "uturn":
        words = f"{name} making a U-turn"
    else:
        words = f"{name} going straight" if rng.random() < 0.9 else name
    if party.tie == "oncoming":
        return f"an oncoming {words}"
    if party.tie == "cross":
        return f"{_choose_article(words)} {words} {_draw_one(('on', 'from'), rng)} the cross street"
    origin = ""
    if party.side is not None:
        origin = _draw_one((f" from the {party.side}", f" coming from the {party.side}"), rng)
    return f"{_choose_article(words)} {words}{origin}"


def _render_walking(party: Party, name: str, rng: np.random.Generator) -> str:
    if party.movement == "jaywalking":
        return _draw_one(("a jaywalker", f"{_choose_article(name)} {name} who is jaywalking"), rng)
    if party.tie == "corner":
        return f"{_choose_article(name)} {name} at the corner"
    if party.crosswalk is None:
        ways = (f"{_choose_article(name)} {name} on the crosswalk", f"a crossing {name}")
        return _draw_one(ways[: 1 + (party.type == "pedestrian")], rng)
    where = (
        f"on the {party.crosswalk} crosswalk", f"crossing the {party.crosswalk} leg",
        f"in the {party.crosswalk} crosswalk",
    )[: 3 if party.type == "pedestrian" else 1]  # fmt: skip
    return f"{_choose_article(name)} {name} {_draw_one(where, rng)}"


def _choose_article(words: str) -> str:
    return "an" if words[0] in "aeioAEIO" or words.startswith("SUV") else "a"


def _capitalize(text: str) -> str:
    return text[:1].upper() + text[1:]


def _draw_one(items: Sequence[ItemT], rng: np.random.Generator) -> ItemT:
    return items[int(rng.integers(len(items)))]


def _draw_weighted(weights: Mapping[str, float], rng: np.random.Generator) -> str:
    share = np.array(list(weights.values()))
    return list(weights)[int(rng.choice(len(share), p=share / share.sum()))]
