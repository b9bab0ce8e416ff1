"""Writes annotated rows of the plain sentences: `python -m lab.planner.plain_sentences OUT`.

The planner has to understand what it offers, and reads a scene that is to be changed in these
sentences. Every row is the description of what an annotated row of the corpus asks for, or that
with the change of an `%edit` row after it, and is kept only if its marks lead to the same plan.
"""

from __future__ import annotations

import random
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.planner import is_same_plan
from scenewright.backends.builtin.reader.annotation import (
    MENTIONS,
    SEPARATOR,
    AnnotatedText,
    parse_annotation,
)
from scenewright.backends.builtin.reader.labels import COMPASS
from scenewright.backends.builtin.reader.learned_plan import LearnedPlan, plan_reading
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.training.corpus import find_row_faults, list_package_files
from scenewright.files import write_atomically
from scenewright.scene.phrasing import choose_names, describe_graph
from scenewright.scene.social import SocialGraph

_MOST = 1600
_TAGS = {"vehicle": "veh", "pedestrian": "ped", "cyclist": "cyc", "scooter": "scoot"}
_SIDES = "(north|east|south|west)"
_WAYS = (
    (rf"on the {_SIDES} crosswalk", "on the [cw:{n} {0} crosswalk]"),
    (rf"from the {_SIDES}", "from the [from:{n} {0}]"),
    (rf"to the {_SIDES}", "to the [to:{n} {0}]"),
    (r"goes (straight)", "goes [straight:{n} straight]"),
    (r"turns (left|right)", "turns [{0}:{n} {0}]"),
    (r"makes a (U-turn)", "makes a [uturn:{n} U-turn]"),
    (r"(crosses)", "[cross:{n} crosses]"),
    (r"(jaywalks)", "[jay:{n} jaywalks]"),
    (r"(runs the red light)", "[red:{n} runs the red light]"),
    (r"(runs across)", "[motion=runs:{n} runs across]"),
    (r"(turns back halfway across)", "[motion=back:{n} turns back halfway across]"),
)
_EVENTS = {
    "collides with": "hit", "rear-ends": "hit=rear", "sideswipes": "hit=side",
    "collides head-on with": "hit=head", "T-bones": "hit=tbone", "narrowly misses": "near",
    "yields to": "yield", "follows": "follow", "tailgates": "lane=tailgate",
    "is pushed into": "push",
}  # fmt: skip
_TIES = {
    "oncoming to": "from=opp", "from the left of": "from=left",
    "from the right of": "from=right", "from the same approach as": "from=same",
    "on the cross street of": "from=lateral", "from another approach than": "from=other",
}  # fmt: skip
_DENSITY = {"light": "low", "moderate": "medium", "heavy": "high"}


class Unworded(Exception):
    """A sentence that has no marks here."""


def annotate(graph: SocialGraph) -> str:
    """The plain sentences of a graph with their marks.

    Raises:
        Unworded: one of its sentences has none.
    """
    names = choose_names(graph)
    numbers = {agent.id: at for at, agent in enumerate(graph.agents, start=1)}
    tags = {names[a.id]: (_TAGS[a.type], numbers[a.id]) for a in graph.agents}
    sentences = describe_graph(graph).rstrip(".").split(". ")
    marked = [
        _mark_agent(sentence, names[agent.id], *tags[names[agent.id]])
        for sentence, agent in zip(sentences, graph.agents, strict=False)
    ]
    marked += [_mark_event(each, tags) for each in sentences[len(graph.agents) :]]
    return ". ".join(marked) + "."


def _mark_agent(sentence: str, name: str, tag: str, number: int) -> str:
    noun = re.escape(name.removeprefix("the "))
    found = re.match(rf"(?:There is )?((?:an? )?{noun})", sentence, re.IGNORECASE)
    if found is None:
        raise Unworded(sentence)
    before, after = sentence[: found.start(1)], sentence[found.end(1) :]
    for pattern, mark in _WAYS:
        after = re.sub(
            rf"(?<![\w:]){pattern}(?![\w\]])",
            lambda m, mark=mark: mark.format(m[1], n=number),  # type: ignore[misc]
            after,
        )
    left = re.sub(
        r"\[[^\]]*\]|comes|and|on the|from the|to the|goes|turns|makes a|leaves", "", after
    )
    if left.strip():
        raise Unworded(sentence)
    return f"{before}[{tag}:{number} {found[1]}]{after}"


def _mark_event(sentence: str, tags: Mapping[str, tuple[str, int]]) -> str:
    who = "|".join(sorted(map(re.escape, tags), key=len, reverse=True))
    plain = sentence[0].lower() + sentence[1:] if sentence.startswith("The ") else sentence
    low = {name.lower(): number for name, (_, number) in tags.items()}
    verbs = "|".join(sorted(map(re.escape, _EVENTS), key=len, reverse=True))
    found = re.fullmatch(
        rf"({who}) ({verbs}) ({who})(?:, and ({who}) passes first)?", plain, re.IGNORECASE
    )
    if found is not None:
        a, b = low[found[1].lower()], low[found[3].lower()]
        first = sentence[: len(found[1])]
        tail = ""
        if found[4]:
            x = low[found[4].lower()]
            tail = f", and [ref:{x} {found[4]}] [first:{x}>{b if x == a else a} passes first]"
        return (
            f"[ref:{a} {first}] [{_EVENTS[found[2]]}:{a}>{b} {found[2]}] [ref:{b} {found[3]}]{tail}"
        )
    ties = "|".join(map(re.escape, _TIES))
    if found := re.fullmatch(rf"({who}) comes ({ties}) ({who})", plain, re.IGNORECASE):
        a, b = low[found[1].lower()], low[found[3].lower()]
        first = sentence[: len(found[1])]
        return (
            f"[ref:{a} {first}] comes [{_TIES[found[2]]}:{a}>{b} {found[2]}] [ref:{b} {found[3]}]"
        )
    if sentence == "Nothing happens":
        return "[normal Nothing happens]"
    if found := re.fullmatch(r"It is (\d\d:\d\d)", sentence):
        return f"It is [time={found[1]} {found[1]}]"
    if found := re.fullmatch(r"The traffic is (\w+)", sentence):
        return f"The traffic is [density={_DENSITY[found[1]]} {found[1]}]"
    if sentence.startswith("There are"):
        return re.sub(r"(\d+|no) background (vehicle|pedestrian)s", _mark_count, sentence)
    raise Unworded(sentence)


def _mark_count(found: re.Match[str]) -> str:
    tag = "bgveh" if found[2] == "vehicle" else "bgped"
    return f"[{tag}={0 if found[1] == 'no' else found[1]} {found[0]}]"


def build_reading(row: AnnotatedText) -> Reading:
    """The reading that an annotation is, as if the encoder had read it without doubt."""
    spans = tuple(
        ReadSpan(
            s.start, s.end, row.text[s.start : s.end], s.tag, s.value, s.negated,
            s.value if s.value in COMPASS else None, s.subjects, s.objects, 1.0,
        )
        for s in row.spans
    )  # fmt: skip
    users = {n: at for at, s in enumerate(row.spans) if s.tag in MENTIONS for n in s.subjects}
    return Reading(row.text, row.kind, 1.0, spans, users)


def _plan(row: AnnotatedText) -> LearnedPlan | None:
    try:
        found = plan_reading(build_reading(row), Site(), row.text)
    except (TypeError, ValueError, KeyError, AttributeError):
        return None
    return found if isinstance(found.plan, SocialGraph) and found.plan.agents else None


def write_rows(seed: int) -> Iterator[str]:
    """Annotated lines: descriptions, then descriptions with a change."""
    lines = [
        line
        for path in list_package_files()
        for line in path.read_text("utf-8").splitlines()
        if line.strip() and not line.startswith(("#", "%off", "%foreign"))
    ]
    random.Random(seed).shuffle(lines)
    count = 0
    for line in lines:
        change = line.startswith("%edit ")
        before, _, after = line.removeprefix("%edit ").partition(SEPARATOR)
        found = _plan(parse_annotation(before))
        if found is None or (not change and count >= _MOST):
            continue
        graph = found.plan
        if not isinstance(graph, SocialGraph) or graph.objects or graph.measures:
            continue
        try:
            plain = annotate(graph)
        except Unworded:
            continue
        again = _plan(parse_annotation(plain))
        if again is None or not is_same_plan(again.plan, graph):
            continue
        if not change:
            count += 1
            yield plain
        elif (renamed := _renumber(after, found)) is not None:
            changed = f"%edit {plain}{SEPARATOR}{renamed}"
            if not list(find_row_faults(parse_annotation(changed))):
                yield changed


def _renumber(change: str, found: LearnedPlan) -> str | None:
    """The change with the numbers that road users have in the description."""
    if not isinstance(found.plan, SocialGraph):
        return None
    at = {agent.id: n for n, agent in enumerate(found.plan.agents, start=1)}
    numbers = {old: at[name] for old, name in found.users.items() if name in at}
    highest = max(numbers.values(), default=0)
    said = re.findall(r"\[!?\w+(?:=\S+?)?:([\d,>]+) ", change)
    for old in sorted({int(n) for each in said for n in re.split("[,>]", each)} - set(numbers)):
        highest += 1
        numbers[old] = highest

    def rename(found: re.Match[str]) -> str:
        return found[1] + re.sub(r"\d+", lambda n: str(numbers[int(n[0])]), found[2]) + " "

    return re.sub(r"(\[!?[a-z]+(?:=[^\s:\]]+)?:)([\d,>]+) ", rename, change)


if __name__ == "__main__":
    rows = list(write_rows(0))
    write_atomically(Path(sys.argv[1]), ("\n".join(rows) + "\n").encode())
    print(len(rows), "rows,", sum(each.startswith("%edit") for each in rows), "of them changes")
