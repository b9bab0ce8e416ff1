"""Turns of a conversation that take away what stands: "remove the parked van"."""

from __future__ import annotations

import re

from scenewright.backends.builtin.reader.words import compile_words, find_subtype
from scenewright.scene.edits import Edit, RemoveObject, Situation
from scenewright.scene.social import ObjectNode

_REMOVES = compile_words("standing_edits.removes")
_ANY_OBJECT = re.compile(r"\b(?:objects?|obstacles?|obstructions?|everything that stands)\b", re.I)
_STATE = re.compile(r"\b(?:double[- ]?parked|parked|stalled|broken[- ]down|standing)\b", re.I)


def find_removed(words: str, situation: Situation) -> tuple[Edit, ...]:
    """The standing objects that the words take away; none if they say nothing of that kind."""
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
