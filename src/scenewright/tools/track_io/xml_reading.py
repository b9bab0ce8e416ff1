"""XML from strangers: a tree, or one line on why it is refused."""

from __future__ import annotations

import math
from typing import NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from scenewright.errors import InputError

MOST_DEPTH = 64


def parse_xml(data: bytes, *, name: str) -> ElementTree.Element:
    """The root element.

    Raises:
        InputError: not well-formed, nested too deeply, or with a document type or entities, which
            no format of tracks needs and which can be made to blow up.
    """
    builder, parser, depth = ElementTree.TreeBuilder(), expat.ParserCreate(), 0

    def refuse(*_: object) -> NoReturn:
        raise InputError(f"{name} declares a document type or entities; no file of tracks does")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MOST_DEPTH:
            raise InputError(f"{name} is nested more than {MOST_DEPTH} deep")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise InputError(f"{name}, line {error.lineno}: not well-formed XML") from error
    return builder.close()


def parse_number(text: str | None, *, name: str, what: str) -> float:
    """A finite number; InputError, saying which one, for anything else."""
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{name}: {what} is {(text or 'missing')[:40]!r}, not a number")
    return value
