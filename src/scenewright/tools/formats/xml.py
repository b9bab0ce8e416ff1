"""XML: nothing that a user wrote becomes markup; what strangers wrote is refused in one line."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable
from typing import BinaryIO, NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from scenewright.errors import InputError

MOST_DEPTH = 64
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def add(parent: ElementTree.Element, name: str, /, **attributes: object) -> ElementTree.Element:
    """A child element; numbers are written in full, booleans as true and false.

    A trailing underscore of a keyword is dropped, so that `class_` writes `class`.
    """
    values = {key.rstrip("_"): format_value(value) for key, value in attributes.items()}
    return ElementTree.SubElement(parent, name, values)


def format_value(value: object) -> str:
    """A value as the text of an attribute; characters that XML cannot hold become U+FFFD."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(float(value))
    return _NOT_XML.sub("\ufffd", str(value))


def write_bytes(root: ElementTree.Element) -> bytes:
    """The document with its declaration, indented; the same tree, the same bytes."""
    ElementTree.indent(root)
    body = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'.encode()


def parse_xml(data: bytes, *, name: str) -> ElementTree.Element:
    """The root element.

    Raises:
        InputError: not well-formed, nested too deeply, or with a document type or entities, which
            no format needs and which can be made to blow up.
    """
    builder = ElementTree.TreeBuilder()
    walk_xml(io.BytesIO(data), builder.start, builder.end, builder.data, name=name)
    return builder.close()


def walk_xml(
    data: BinaryIO,
    start: Callable[[str, dict[str, str]], object],
    end: Callable[[str], object] | None = None,
    text: Callable[[str], object] | None = None,
    *,
    name: str,
) -> None:
    """Call handlers as elements begin, as they end and as text comes; raises as `parse_xml`."""
    depth = 0

    def begin_element(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MOST_DEPTH:
            raise InputError(f"{name} is nested deeper than {MOST_DEPTH} elements")
        start(tag, attributes)

    def end_element(tag: str) -> None:
        nonlocal depth
        depth -= 1
        if end is not None:
            end(tag)

    def refuse(*_: object) -> NoReturn:
        raise InputError(
            f"{name} declares a document type or entities, which no format needs; "
            "remove the <!DOCTYPE ...> if you trust the file"
        )

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = begin_element, end_element
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = refuse  # nothing else declares entities
    try:
        parser.ParseFile(data)
    except expat.ExpatError as error:
        told = f"{name}, line {error.lineno}: not well-formed XML; is it cut off?"
        raise InputError(told) from error


def parse_number(text: str | None, *, name: str, what: str) -> float:
    """A finite number; InputError, saying which one, for anything else."""
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{name}: {what} is {(text or 'missing')[:40]!r}, not a number")
    return value
