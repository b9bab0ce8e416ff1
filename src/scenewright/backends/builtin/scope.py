"""What cannot be planned at all: no traffic, another language, agents and places we do not have."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from importlib.resources import files

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.lexicon import Chunk, load_lexicon
from scenewright.backends.builtin.normalise import Token

MOST_CHARACTERS = 2_000
_CONTROL = re.compile(
    r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
_QUESTION = re.compile(
    r"^\s*(?:(?:how (?!about)|what(?!\s+(?:if|about|happens (?:if|when)|an? (?!.*\?)))|why|who|"
    r"where|"
    r"when (?:is|was|did|do|will)|which|tell me|explain|define|translate|summari[sz]e|"
    r"is it|are there any laws|do i|should i)\b)"
)
_HITS = re.compile(r"\b(?:hit|strik|struck|miss|touch|collid|crash)")
_EVIDENCE = (
    "COLLIDE", "NEAR", "YIELD", "FOLLOW", "WAIT", "BOUND", "NORMAL", "XWALK", "CROSS", "JAYWALK",
    "TURN", "STRAIGHT", "UTURN", "COMPASS", "REDRUN", "OPPOSITE", "DENSITY",
    "TIMEWORD", "LET", "HEAD", "SIGNAL", "ROAD", "SAME",
)  # fmt: skip
_EDITS = ("AGENT", "EDIT", "BUSIER", "NOBODY", "BACKGROUND", "LEVEL", "LEFT", "RIGHT")
_BAD_AGENT = {
    "bicycle": "Rickshaws and the like are not a class of this generator",
    "scooter": "Skateboards and the like are not a class of this generator",
    "rail": "Trains and trams are not a class of this generator",
    "animal": "Animals are not a class of this generator",
    "aircraft": "Aircraft are not a class of this generator",
    "ship": "Ships are not a class of this generator",
    "other": "This agent is not a class of this generator",
}


def check_text(text: str) -> None:
    """Refused for blank, oversized or unprintable text."""
    if not text.strip():
        raise Refused(
            "out_of_scope",
            "The instruction is blank; describe a traffic scene at the intersection.",
        )
    if len(text) > MOST_CHARACTERS:
        raise Refused(
            "out_of_scope",
            f"The instruction has {len(text)} characters; describe the scene in at most "
            f"{MOST_CHARACTERS}.",
        )
    if _CONTROL.search(text):
        raise Refused("out_of_scope", "The instruction holds control characters; write plain text.")


def check_language(text: str, tokens: Sequence[Token]) -> None:
    """Refused unless most words are English and one of them is a word at all."""
    letters = [char for char in text if char.isalpha()]
    latin = sum(char.isascii() for char in letters)
    if not letters or latin < 0.8 * len(letters):
        raise build_not_english()
    words = [token.text for token in tokens if token.text.isalpha()]
    foreign_words = _load_foreign_words()
    foreign = sum(word in foreign_words for word in words)
    if not words or not _is_familiar(tokens) or (foreign >= 2 and foreign >= 0.2 * len(words)):
        raise build_not_english()


@lru_cache(maxsize=1)
def _load_foreign_words() -> frozenset[str]:
    """Function words that betray another language."""
    source = files("scenewright.backends.builtin").joinpath("foreign.txt")
    return frozenset(source.read_text("utf-8").split())


def _is_familiar(tokens: Sequence[Token]) -> bool:
    words = load_lexicon()
    return (
        words.measure_familiar(tokens) >= 0.2
        and words.measure_familiar(words.correct_tokens(tokens)) >= 0.6
    )


def check_scope(
    clean: str, chunks: Sequence[Chunk], *, editing: bool = False, measured: bool = False
) -> None:
    """Refused for agents, places and motions that no scene here can hold.

    Args:
        measured: the text gives a PET or a TTC, which nothing but a scene has.
    """
    for at, chunk in enumerate(chunks):
        if chunk.has("BAD_AGENT") and not _is_excused(chunks, at):
            reason = _BAD_AGENT[chunk.tags["BAD_AGENT"]]
            raise Refused(
                "out_of_scope",
                f"{reason} ({chunk.text}); use vehicles, cyclists, e-scooters and pedestrians.",
            )
        if chunk.has("BAD_PLACE") and not _is_excused(chunks, at):
            raise Refused(
                "out_of_scope",
                "Scenes take place at a four-leg intersection, not at a "
                f"{chunk.tags['BAD_PLACE']}; move it there.",
            )
        if chunk.has("BAD_OBJECT") and _is_struck(chunks, at):
            raise Refused(
                "out_of_scope",
                f"Only vehicles and pedestrians take part, not a {chunk.text}; name one of them.",
            )
        if chunk.has("IMPOSSIBLE"):
            raise Refused(
                "impossible",
                f"Vehicles and pedestrians cannot do that ({chunk.text}); leave it out.",
            )
        if chunk.has("SIDEWALK") and _is_driving_there(chunks, at):
            raise Refused(
                "impossible",
                "Vehicles stay on the road here, not on the sidewalk; move the vehicle "
                "to the road.",
            )
    if _QUESTION.search(clean):
        raise build_nothing_planned()
    evidence = _EVIDENCE + _EDITS if editing else _EVIDENCE
    first = any(chunk.has("GO_FIRST") and chunk.text.endswith(" first") for chunk in chunks)
    if not (first or measured) and not any(chunk.has(*evidence) for chunk in chunks):
        raise build_nothing_planned()


def build_nothing_planned() -> Refused:
    """The verdict on a text that names no agent and no event."""
    return Refused(
        "out_of_scope",
        "The text describes no traffic scene; say which vehicles or pedestrians do "
        "what at the intersection.",
    )


def build_not_english() -> Refused:
    """The verdict on a text in another language."""
    return Refused(
        "out_of_scope",
        "The text does not seem to be English; describe the scene in English.",
    )


def _is_excused(chunks: Sequence[Chunk], at: int) -> bool:
    """ "walking her dog" and "no cyclists" bring no such agent into the scene."""
    before = [chunk.text for chunk in chunks[max(0, at - 3) : at]]
    if chunks[at].tags.get("BAD_AGENT") == "animal":
        return any(word in {"walking", "with", "walks"} for word in before) and _has_agent(
            chunks[:at]
        )
    return bool(before) and before[-1] in {"no", "without", "not", "near the", "pushing"}


def _has_agent(chunks: Sequence[Chunk]) -> bool:
    return any(chunk.has("AGENT") for chunk in chunks)


def _is_struck(chunks: Sequence[Chunk], at: int) -> bool:
    for chunk in reversed(chunks[max(0, at - 4) : at]):
        if chunk.has("COLLIDE") or (chunk.has("NEAR") and _HITS.search(chunk.text)):
            return True
        if chunk.has("AGENT") or chunk.mark:
            return False
    return False


def _is_driving_there(chunks: Sequence[Chunk], at: int) -> bool:
    for chunk in reversed(chunks[max(0, at - 8) : at]):
        if chunk.has("AGENT"):
            return chunk.tags["AGENT"].startswith("vehicle")
        if chunk.mark in {".", ";"} or chunk.has("COLLIDE", "YIELD", "WAIT", "LET"):
            return False
    return False
