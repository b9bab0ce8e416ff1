"""Severity of an event: where vehicles strike one another, and whether an agent brakes hard."""

from __future__ import annotations

import re
from dataclasses import dataclass

from scenewright.backends.builtin.reader.words import WORDS
from scenewright.scene.social import ImpactPoint

_ENDS: dict[str, ImpactPoint] = {"front": "front", "rear": "rear", "back": "rear"}
_CORNERS: dict[tuple[str, str], ImpactPoint] = {
    ("front", "left"): "front_left", ("front", "right"): "front_right",
    ("rear", "left"): "rear_left", ("rear", "right"): "rear_right",
}  # fmt: skip
_SIDES: dict[str, ImpactPoint] = {
    "left": "left", "driver": "left", "drivers": "left",
    "right": "right", "passenger": "right", "passengers": "right",
}  # fmt: skip
_PART = r"(?:corner|fender|bumper|quarter|wing|headlight|tail ?light|wheel|end|side|panel)s?"
_POINT = (
    rf"(?:(?P<end>front|rear|back)[ -](?P<hand>left|right)(?:[ -]hand)?(?: {_PART})*"
    rf"|(?P<hand2>left|right)(?:[ -]hand)?[ -](?P<end2>front|rear|back)(?: {_PART})*"
    r"|(?P<side>left|right|driver(?:'?s)?|passenger(?:'?s)?)(?:[ -]hand)?[ -]+(?:side|flank|doors?)"
    r"|(?P<plain>front|rear|back)(?:[ -](?:end|bumper|side))?"
    r"|(?P<any>sides?|flank|doors?))"
)
_VERB: str = WORDS["impacts"]["verb"]
_NO_VEHICLE = (
    r"(?! of (?:the |an? )?(?:\w+ )?(?:road|street|intersection|crosswalk|junction|map|screen|"
    r"avenue|leg|lane|crossing))"
)
_STRUCK_AT = re.compile(
    rf"(?P<before>{_VERB}(?: straight| right| head on)?(?: in ?to| against| with)?)"
    rf" (?:the|its|his|her) {_POINT}{_NO_VEHICLE} of(?= (?:the|an?|its|another|one)\b)"
)
_STRUCK_BY = re.compile(rf"(?P<before>\bby) (?:the|its) {_POINT}{_NO_VEHICLE} of(?= (?:the|an?)\b)")
_ON = re.compile(
    rf"(?P<before>{_VERB}(?:(?!\bwith\b)[^.;,])*?) (?:on|in|at|along)(?: to)?"
    rf" (?:the|its|his|her|their) {_POINT}\b{_NO_VEHICLE}(?! (?:of|lane|turn))"
)
_OWN = re.compile(rf"(?P<before>{_VERB}(?:(?!\bwith\b)[^.;,])*?\w)  {_POINT}\b{_NO_VEHICLE}")
"""A genitive leaves two blanks behind: "hits the bus's side"."""

_WITH = re.compile(rf"(?P<before>),? with (?:the|its|his|her|their) {_POINT}\b(?! of)")


@dataclass(frozen=True)
class Impacts:
    """Where the striking and the struck vehicle touch; None where the text does not say."""

    striking: ImpactPoint | None = None
    struck: ImpactPoint | None = None


def read_impacts(text: str) -> Impacts:
    """The points of impact that a text in lower case names."""
    found: dict[str, ImpactPoint] = {}
    for pattern, party in (
        (_STRUCK_BY, "striking"), (_STRUCK_AT, "struck"), (_WITH, "striking"), (_ON, "struck"),
        (_OWN, "struck"),
    ):  # fmt: skip
        match = pattern.search(text)
        if match is None or party in found:
            continue
        end, hand = match["end"] or match["end2"], match["hand"] or match["hand2"]
        if end and hand:
            found[party] = _CORNERS[_ENDS[end], hand]
        elif match["side"]:
            found[party] = _SIDES[match["side"].replace("'", "")]
        else:
            found[party] = _ENDS[match["plain"]] if match["plain"] else "side"
        # "into the back of a bus" is a rear-end, which the words themselves must go on saying.
        if not (match["plain"] and found[party] == "rear"):
            text = f"{text[: match.start()]}{match['before']}{text[match.end() :]}"
    return Impacts(found.get("striking"), found.get("struck"))
