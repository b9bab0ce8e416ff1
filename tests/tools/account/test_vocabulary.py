"""Texts are cut into tokens with senses; misspelt words are mended; times and figures are read."""

import re
from pathlib import Path

import pytest

from scenewright.tools.account import vocabulary
from scenewright.tools.account.claim_tests import read_clock
from scenewright.tools.account.vocabulary import load_vocabulary, read_tokens, reduce_word


@pytest.mark.parametrize(
    ("word", "stem"),
    [
        ("hits", "hit"),
        ("hitting", "hit"),
        ("yielded", "yield"),
        ("lorries", "lorry"),
        ("gave", "giv"),
        ("bus", "bus"),
        ("proceeds", "proceed"),
        ("proceed", "proceed"),
        ("red", "red"),
    ],
)
def test_words_are_reduced_to_their_stem(word: str, stem: str) -> None:
    assert reduce_word(word) == stem


def test_tokens_keep_their_place_and_sentence() -> None:
    text = "A car turns. It hits a van"
    tokens = read_tokens(text)
    assert [text[t.start : t.end].lower() for t in tokens] == [t.text for t in tokens]
    assert [t.sentence for t in tokens] == [0, 0, 0, 1, 1, 1, 1, 1]
    assert [t.kind for t in tokens] == ["word"] * 3 + ["end"] + ["word"] * 4


def test_a_phrase_is_more_than_its_words() -> None:
    green, light = read_tokens("green light")
    assert green.senses["light"] == light.senses["light"] == (0, 2)
    assert not green.has("manner")  # "green" alone is a colour


def test_senses_stand_in_an_order_that_does_not_change() -> None:
    for token in read_tokens("a pedestrian crossing stops as it runs into the side"):
        assert list(token.senses) == sorted(token.senses)


@pytest.mark.parametrize("verb", ["doesn't", "couldn't", "shouldn’t", "wont", "hasnt"])
def test_a_negation_is_read_from_the_end_of_its_verb(verb: str) -> None:
    assert [t.has("negation") for t in read_tokens(f"it {verb} stop")] == [False, True, False]


def test_two_words_of_a_phrase_may_be_written_as_one() -> None:
    text = "a truck runs the redlight"
    tokens = read_tokens(text)
    assert [text[t.start : t.end] for t in tokens if t.has("red")] == [
        "runs",
        "the",
        "red",
        "light",
    ]


@pytest.mark.parametrize("whom", ["him", "me", "us"])
def test_a_pronoun_may_stand_within_a_verb(whom: str) -> None:
    assert all(t.has("event.collision") for t in read_tokens(f"runs {whom} over"))


@pytest.mark.parametrize(
    ("slip", "known"),
    [
        ("cra", "car"), ("bicicle", "bicycle"), ("crosswlak", "crosswalk"), ("hitt", "hit"),
        ("brekas", "brakes"), ("vehical", "vehicle"),
    ],
)  # fmt: skip
def test_a_slip_is_mended_and_said(slip: str, known: str) -> None:
    (token,) = read_tokens(slip)
    assert (token.text, token.mended, token.stem) == (known, known, reduce_word(known))
    assert token.senses == read_tokens(known)[0].senses


@pytest.mark.parametrize("word", ["car", "cat", "zyzzyva"])
def test_known_words_and_those_like_none_are_left_alone(word: str) -> None:
    (token,) = read_tokens(word)
    assert (token.text, token.mended) == (word, None)


@pytest.mark.parametrize(
    ("text", "number", "unit"),
    [
        ("30 km/h", 30.0, "km/h"),
        ("1,5 s", 1.5, "s"),
        ("2.5m/s²", 2.5, "m/s²"),
        ("12", 12.0, None),
        ("seven", 7.0, None),
    ],
)
def test_figures_are_read_with_their_unit(text: str, number: float, unit: str | None) -> None:
    (token,) = read_tokens(text)
    assert (token.number, token.unit) == (number, unit)


@pytest.mark.parametrize(
    ("text", "minutes"),
    [
        ("5:30 pm", [1050]),
        ("12 am", [0]),
        ("12:15 p.m.", [735]),
        ("05:30", [330]),
        ("5:30", [330, 1050]),
        ("17:30", [1050]),
    ],
)
def test_clock_times_are_one_token(text: str, minutes: list[int]) -> None:
    (token,) = read_tokens(text)
    assert token.kind == "clock"
    assert read_clock(token.text) == minutes


def test_the_code_asks_for_the_lists_that_there_are() -> None:
    code = "".join(p.read_text("utf-8") for p in Path(vocabulary.__file__).parent.glob("*.py"))
    calls = re.findall(r"is_in\(([^)]*)\)|lists\[([^\]]*)\]", code)
    asked = {name for call in calls for part in call for name in re.findall(r'"(\w+)"', part)}
    asked |= {"removes", "adds"}  # asked for by turns
    assert asked == load_vocabulary().lists.keys()


def test_a_pronoun_between_a_verb_and_its_particle_leaves_other_words_as_they_are() -> None:
    (_, _, runs, *_) = read_tokens("the car runs him over")
    assert runs.has("event.collision")
    hits, stem = read_tokens("hits him off"), read_tokens("hits him")
    assert hits[0].senses.keys() == stem[0].senses.keys()
