"""XML of user text and numbers: nothing that a user wrote becomes markup."""

from __future__ import annotations

import re
from xml.etree import ElementTree

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
