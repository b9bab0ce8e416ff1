"""Turns of a conversation about what stands: "add a parked truck", "remove the van"."""

from __future__ import annotations

import re

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.words import find_subtype
from scenewright.backends.builtin.standing import (
    StandingPhrase,
    find_addition,
    find_pair,
    take_out,
)
from scenewright.scene.edits import AddObject, Edit, RemoveObject, Situation
from scenewright.scene.social import MOST_OBJECTS, ObjectNode

_REMOVES = re.compile(
    r"^(?:please |now |then )*(?:remove|delete|drop|get rid of|take away|take out|lose) "
    r"(?P<what>(?:the |that |this |all )?.+?)[.!]?$",
    re.IGNORECASE,
)
_ANY_OBJECT = re.compile(r"\b(?:objects?|obstacles?|obstructions?|everything that stands)\b", re.I)
_STATE = re.compile(r"\b(?:double[- ]?parked|parked|stalled|broken[- ]down|standing)\b", re.I)
_NOTHING_ELSE = re.compile(
    r"^(?:please|now|then|also|and|so|that|have|let|make|put|add|place|the|a|her|him|them|it|she|"
    r"he|pedestrian|woman|man|child|boy|girl|walker|person|step|steps|come|comes|walk|walks|out|"
    r"stand|stands|is|be|\W)*$",
    re.IGNORECASE,
)


def read_standing_edits(words: str, situation: Situation) -> tuple[Edit, ...]:
    """The edits that the words ask for, if they speak of nothing but what stands; else none.

    Raises:
        Refused: it is not clear which agent an object is to hide, or there would be too many.
    """
    removed = _find_removed(words, situation)
    if removed:
        return removed
    phrases = find_addition(words) or _find_hiding(words)
    if not phrases:
        return ()
    objects = situation.graph.objects
    if len(objects) + len(phrases) > MOST_OBJECTS:
        raise Refused("out_of_scope", f"At most {MOST_OBJECTS} standing objects can be placed.")
    first = max((int(each.id.split("-")[1]) for each in objects), default=0) + 1
    return tuple(
        AddObject(node=_make_node(phrase, number, situation))
        for number, phrase in enumerate(phrases, start=first)
    )


def _find_hiding(words: str) -> tuple[StandingPhrase, ...]:
    """ "Have her step out from behind a parked truck": no more is said than that."""
    rest, phrases = take_out(words)
    return phrases if _NOTHING_ELSE.match(rest.strip()) else ()


def _make_node(phrase: StandingPhrase, number: int, situation: Situation) -> ObjectNode:
    node = phrase.make_node(number)
    if not phrase.hides:
        return node
    driver, walker = find_pair(situation.graph.model_copy(update={"said": ()}), phrase)
    return node.model_copy(update={"hides": walker, "hidden_from": driver, "lead": phrase.lead})


def _find_removed(words: str, situation: Situation) -> tuple[Edit, ...]:
    match = _REMOVES.match(" ".join(words.split()))
    objects = situation.graph.objects
    if match is None or not objects:
        return ()
    what = match["what"]
    if _ANY_OBJECT.search(what):
        return tuple(RemoveObject(object=each.id) for each in objects)
    named = [each for each in objects if each.id in what or _is_meant(each, what)]
    moving = {each.subtype for each in situation.present} & {find_subtype(what)} - {None}
    if len(named) != 1 or (moving and not _STATE.search(what) and named[0].id not in what):
        return ()
    return (RemoveObject(object=named[0].id),)


def _is_meant(node: ObjectNode, what: str) -> bool:
    """Whether words such as "the parked truck" or "the bin" name an object."""
    kind = node.kind.replace("_", "[- ]?")
    subtype = find_subtype(what)
    if subtype is not None:
        return subtype == (node.subtype or ("bus" if node.kind == "bus_stop" else None))
    return re.search(rf"\b{kind}\b", what, re.IGNORECASE) is not None
