"""Questions in words: a stage's prompt.md with the facts of the scene put in.

Whatever users, files and models wrote stands in a prompt as a JSON text of bounded length, so that
it can neither end its place nor pose as a rule.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from scenewright.backends import Prompt

LONGEST_REQUEST = 2000
"""Characters of an instruction that a model is shown; builtin reads no more either."""

MOST_TOKENS = 2000
"""Of a question and its schema, which some providers count as well; examples fill what is left."""

MOST_EXAMPLES = 3
MOST_FAULTS = 3
_LONGEST_FAULT = 400
_USER = "=== user ==="
_LINE_ENDS = re.compile("[\u0085\u2028\u2029]")
_PIECES = re.compile(r"[A-Za-z]+|\d|[^\sA-Za-z\d]+")
_PLACE = re.compile(r"<<([a-z]+)>>")


@dataclass(frozen=True)
class Example:
    """A request of an accepted scene, and the answer that led to it."""

    request: str
    answer: Mapping[str, Any]


_LEFT_HAND = (
    "Traffic drives on the left: the turn across oncoming traffic is the right one, and kind "
    "left_turn means that one.\n"
)

ExampleRetriever = Callable[[str, str], Sequence[Example]]
"""(task, instruction) -> examples for the prompt, most alike first."""


def recall_nothing(_task: str, _instruction: str) -> Sequence[Example]:
    """No memory, no examples."""
    return ()


def render_prompt(
    stage: str,
    name: str,
    values: Mapping[str, str],
    *,
    schema: dict[str, Any],
    examples: Sequence[Example] = (),
) -> Prompt:
    """A prompt with its places filled, in one pass: what is put in is never read as a place.

    Args:
        examples: as many as there is room for stand in the place of that name.
    """
    system, user = _load_prompt(stage, name)
    bare = "".join((_fill_places(system, values), _fill_places(user, {**values, "examples": ""})))
    room = MOST_TOKENS - count_tokens(bare) - count_tokens(format_json(schema))
    values = {**values, "examples": format_examples(examples, room=room)}
    return Prompt(
        system=_fill_places(system, values), user=_fill_places(user, values), schema=schema
    )


def count_tokens(text: str) -> int:
    """About how many tokens a text is, rather too many than too few.

    Of prompts and schemas the encodings cl100k_base and o200k_base made 83 to 100 % of it.
    """
    return sum(_weigh_piece(piece) for piece in _PIECES.findall(text))


def _weigh_piece(piece: str) -> int:
    if not piece.isascii():
        return 2 * len(piece)
    return math.ceil(len(piece) / (7 if piece.isalpha() else 3))


def quote_text(text: str, *, most: int = LONGEST_REQUEST) -> str:
    """A text as data: one JSON string, cut where it is too long."""
    kept = text if len(text) <= most else text[:most] + "…"
    return _join_lines(json.dumps(kept, ensure_ascii=False))


def format_json(value: Any) -> str:
    """A value as short JSON."""
    return _join_lines(json.dumps(value, ensure_ascii=False, separators=(",", ":")))


def _join_lines(text: str) -> str:
    """JSON as it can be sent; lone surrogates cannot, and some separators pass for line ends."""
    sendable = text.encode("utf-8", "replace").decode("utf-8")
    return _LINE_ENDS.sub(" ", sendable)


def describe_driving_side(left_hand: bool) -> str:
    """On which side people drive, where it is not the right; a line of its own."""
    return _LEFT_HAND if left_hand else ""


def format_words(words: Sequence[Mapping[str, Any]]) -> str:
    """Numbered words of the request, each quoted, with the agents that they describe."""
    return ", ".join(
        f"{word['number']} {quote_text(word['words'], most=_LONGEST_FAULT)}"
        + (f" ({', '.join(word['agents'])})" if word["agents"] else "")
        for word in words
    )


def format_rejections(rejections: Sequence[str]) -> str:
    """Why earlier answers were refused, the latest last."""
    if not rejections:
        return ""
    lines = [
        f"- {quote_text(rejection, most=_LONGEST_FAULT)}" for rejection in rejections[-MOST_FAULTS:]
    ]
    return "\n".join(
        ["", "Your earlier answer was refused. Mend exactly this, keep the rest:", *lines]
    )


def format_examples(examples: Sequence[Example], *, room: int = MOST_TOKENS) -> str:
    """Accepted answers to requests like this one, the first ones that take no more tokens."""
    text = "Accepted before:\n"
    count = 0
    for example in examples:
        more = f"Request: {quote_text(example.request, most=400)}\n{format_json(example.answer)}\n"
        if count < MOST_EXAMPLES and count_tokens(text + more) <= room:
            text, count = text + more, count + 1
    return text if count else ""


@cache
def _load_prompt(stage: str, name: str) -> tuple[str, str]:
    text = files("scenewright.nodes").joinpath(stage, name).read_text("utf-8")
    system, _, user = text.partition(f"{_USER}\n")
    return system.strip(), user.strip()


def _fill_places(text: str, values: Mapping[str, str]) -> str:
    return _PLACE.sub(lambda found: values[found[1]], text)
