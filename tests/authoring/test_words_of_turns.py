"""The vocabulary of conversations: what it names is there, and nothing stands there unused."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from scenewright.authoring import answer_question
from scenewright.backends import builtin
from scenewright.backends.offline import WORDS, Patterns, fill_in

MODULES = (
    "answer_question", "find_version", "intent_edits", "read_turn", "second_opinion", "session",
    "talk", "turn_kind",
)  # fmt: skip


def test_every_topic_of_the_vocabulary_has_an_answer() -> None:
    topics = {name for name, _ in WORDS["answer_question"]["topics"]}
    assert topics <= answer_question._ANSWERS.keys()


def test_every_part_is_put_in_and_none_is_unused() -> None:
    texts = str([WORDS[module] for module in (*MODULES, "turn_parts")])
    assert WORDS["turn_parts"].keys() <= set(re.findall(r"\{([a-z_]+)\}", texts))
    for _, _, pattern in WORDS["intent_edits"]["opposites"]:
        re.compile(fill_in(pattern))


@pytest.mark.parametrize("module", MODULES)
def test_a_module_asks_for_all_its_words(module: str) -> None:
    code = Path(answer_question.__file__).with_name(f"{module}.py").read_text("utf-8")
    asked = re.findall(rf'\b_PATTERNS\.(\w+)|WORDS\["{module}"\]\["(\w+)"\]', code)
    assert {one or other for one, other in asked} == WORDS[module].keys()


@pytest.mark.parametrize("path", sorted(Path(builtin.__path__[0]).rglob("*.py")), ids=str)
def test_a_module_of_the_planner_asks_for_all_its_patterns_and_each_is_there(path: Path) -> None:
    code = path.read_text("utf-8")
    for part in re.findall(r'^_PATTERNS = Patterns\("(\w+)"\)', code, re.MULTILINE):
        patterns = Patterns(part)
        asked = set(re.findall(r"\b_PATTERNS\.(\w+)", code))
        assert all(isinstance(getattr(patterns, name), re.Pattern) for name in asked)
        others = re.findall(rf'WORDS\["{part}"\]\["(\w+)"\]', code)
        assert WORDS[part].keys() == asked | {*others}


def test_a_pattern_that_is_not_there_is_named() -> None:
    with pytest.raises(AttributeError, match=r"no talk\.nothing"):
        _ = Patterns("talk").nothing
