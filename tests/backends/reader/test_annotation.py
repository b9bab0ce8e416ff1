"""Annotated instructions: read, written back, turned, and checked."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annotated_readings import format_annotation
from lab.planner.plain_sentences import build_reading
from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.reader.annotation import (
    AnnotatedText,
    AnnotationError,
    Span,
    parse_annotation,
)
from scenewright.backends.builtin.reader.learned_plan import plan_reading
from scenewright.backends.builtin.training.augmentation import augment, collect_spans, turn
from scenewright.backends.builtin.training.corpus import (
    find_faults,
    list_package_files,
    read_corpus,
)
from scenewright.scene.social import SocialGraph

LINE = (
    "[veh:1 A blue van] from the [from:1 north] [left:1 turns left] and [near:1>2 just misses] "
    "[ped:2 a man] on the [cw:2 east crosswalk] [time=08:00 at 8 am]."
)


def graph_of(line: str) -> SocialGraph:
    row = parse_annotation(line)
    plan = plan_reading(build_reading(row), Site(), row.text).plan
    assert isinstance(plan, SocialGraph), plan
    return plan


def test_a_line_is_its_text_and_its_spans() -> None:
    row = parse_annotation(LINE)
    assert row.text.startswith("A blue van from the north turns left and just misses a man")
    assert [row.text[s.start : s.end] for s in row.spans][:3] == [
        "A blue van", "north", "turns left",
    ]  # fmt: skip
    near = next(span for span in row.spans if span.tag == "near")
    assert (near.subjects, near.objects) == ((1,), (2,))
    assert format_annotation(row) == LINE


@pytest.mark.parametrize("line", ["[vehicle:1 a car] drives", "a [ car", "[veh:1 a car]]"])
def test_brackets_that_make_no_tag_are_refused(line: str) -> None:
    with pytest.raises(AnnotationError):
        parse_annotation(line)


words = st.text(st.characters(codec="ascii", exclude_characters="[]\\\n%"), min_size=1, max_size=9)


@given(st.lists(st.tuples(words, st.sampled_from(["veh", "from", "hit"]), words), max_size=5))
def test_what_is_written_is_read_back(pieces: list[tuple[str, str, str]]) -> None:
    text, spans = "", []
    for before, tag, found in pieces:
        said = found.strip() or "x"
        text += before
        spans.append(Span(len(text), len(text) + len(said), tag, None, False, (1,), (2,)))
        text += said
    row = AnnotatedText(text, tuple(spans))
    assert parse_annotation(format_annotation(row)) == row


RIGHT = {"north": "east", "east": "south", "south": "west", "west": "north", None: None}
MIRROR = {"north": "north", "east": "west", "south": "south", "west": "east", None: None}
SWAPPED = {"left": "right", "right": "left"}
ROWS = [
    LINE,
    "[veh:1 A NB truck] [right:1 RT], hits [ped:2 him] [cw:2 E xwalk] [hit:1>2 bang]",
    "[veh:1 Bus] [heading:1 westbound] [yield:1>2 waits for] [from=left:2>1 one from its left] "
    "[veh:2 a cab]",
    "[ped:1 A girl] walks from [from:1 east] to [to:1 west] on the [cw:1 south crosswalk]; "
    "[veh:2 a lorry] [yield:2>1 lets her cross]",
]


@pytest.mark.parametrize("line", ROWS)
def test_a_turned_row_means_the_turned_scene(line: str) -> None:
    before, row = graph_of(line), parse_annotation(line)
    turned = graph_of(format_annotation(turn(row, 1, mirrored=False)))
    mirrored = graph_of(format_annotation(turn(row, 0, mirrored=True)))
    for agent, once, seen in zip(before.agents, turned.agents, mirrored.agents, strict=True):
        for name in ("entry", "exit", "crosswalk"):
            assert getattr(once, name) == RIGHT[getattr(agent, name)]
            assert getattr(seen, name) == MIRROR[getattr(agent, name)]
        assert once.movement == agent.movement
        assert seen.movement == SWAPPED.get(agent.movement or "", agent.movement)


@pytest.mark.parametrize("line", ROWS)
def test_four_quarter_turns_are_none(line: str) -> None:
    row = parse_annotation(line)
    for _ in range(4):
        row = turn(row, 1, mirrored=False)
    assert format_annotation(row) == line


def test_variations_keep_relations_and_agents() -> None:
    rows = [parse_annotation(line) for line in ROWS]
    rng, bank = random.Random(3), collect_spans(rows)
    for _ in range(60):
        line = rng.choice(ROWS)
        varied = graph_of(format_annotation(augment(parse_annotation(line), rng, bank)))
        assert [e.type for e in varied.relations] == [e.type for e in graph_of(line).relations]
        assert [a.type for a in varied.agents] == [a.type for a in graph_of(line).agents]


def test_faults_are_named_with_their_line(tmp_path: Path) -> None:
    file = tmp_path / "mine.txt"
    file.write_text(
        "# a comment\n[veh:1 a car] [hit hits] [ped:2 a man]\n[veh:1 a car] [ref:3 it]\n"
        "[density=loud traffic]\n[veh a car]\n"
    )
    found = list(find_faults(file))
    assert [each.partition(":")[0] for each in found] == ["line 2", "line 3", "line 4", "line 5"]


def test_the_packages_instructions_are_without_fault() -> None:
    files = list_package_files()
    assert files
    assert [fault for file in files for fault in find_faults(file)] == []
    assert len(read_corpus(files)) > 5_000
