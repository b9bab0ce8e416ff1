"""What is read out of a reply, and what is told of one that cannot be read."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.backends.text_backend import LONGEST, Unreadable, extract_object

_TEXT = st.text(st.characters(exclude_categories=("C",)), max_size=12)
_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    | _TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_TEXT, inner, max_size=3),
    max_leaves=8,
)  # fmt: skip
_OBJECTS = st.dictionaries(_TEXT, _VALUES, max_size=4)
_PROSE = st.text("abc .,:\n", max_size=30)


@given(_OBJECTS, _PROSE, _PROSE)
def test_an_object_is_read_whatever_prose_stands_round_it(value, before, after):
    text = json.dumps(value)
    assert extract_object(text) == value
    assert extract_object(f"{before}{text}{after}") == value
    assert extract_object(f"{before}\n```json\n{json.dumps(value)}\n```\n{after}") == value or (
        "```" in text
    )


@given(_OBJECTS)
def test_a_reply_cut_off_is_never_taken_for_a_whole_one(value):
    text = json.dumps({"first": value, "last": [1, {"inner": 2}]})
    for end in range(len(text)):
        with pytest.raises(Unreadable):
            extract_object(text[:end])


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused_in_one_sentence(text):
    read, facts = _read(text)
    assert isinstance(read, dict) or 0 < len(facts) < 200


def _read(text):
    try:
        return extract_object(text), ""
    except Unreadable as error:
        return None, str(error)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("  \n", "is empty"),
        ("<think>hm</think>", "is empty"),
        ("no", "no JSON object"),
        ("[1]", "is a JSON list"),
        ("```\n3\n```", "is a JSON number"),
        ('{"a": 1}{"b": 2}', "2 JSON values"),
        ('{"a": {"b": NaN}}', "NaN is no number"),
        ('{"a": -Infinity}', "-Infinity is no number"),
        ('{"a": 1e400}', "1e400 is no number"),
        ('{"a": 1, "a": 1}', "'a' stands twice"),
        ('{"a": "x\x00"}', "Invalid control character at line 1"),
        ('{"a": "\\u0007"}', "control character U+0007"),
        ('{"\\u001b": 1}', "control character U+001B"),
        ('{"a": "\\ud800"}', "control character U+D800"),
        ("{'a': 1}", "Expecting property name"),
        ('{"a": 1,}', "at line 1, column"),
        ('{"a":' * 100_000, "characters"),
        ('{"a":' * 15_000, "not JSON"),
        ("x" * (LONGEST + 1), f"has {LONGEST + 1} characters"),
    ],
)
def test_what_is_wrong_is_reported(text, words):
    with pytest.raises(Unreadable) as caught:
        extract_object(text)
    assert words in str(caught.value)


def test_what_stands_inside_a_broken_object_is_not_taken_for_the_answer():
    for broken in ('Well: {"agents": [{"id": 1}], "x": NaN}', '{"a": {"agents": []}, "b'):
        with pytest.raises(Unreadable):
            extract_object(broken)
