"""Protocol buffer messages from a table of fields, without generated code.

A schema is text: one message per line, `Name: field number type, …`, where a type is a scalar of
protobuf or another message, and `*` before it says that the field is repeated, `+` that it is
repeated and packed. Enumerations are int32, which have the same bytes. Fields that a schema leaves
out are skipped when reading.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


def _load(module: str) -> Any:
    """A module of protobuf, which has no types."""
    return import_module(f"google.protobuf.{module}")


_SCALARS = (
    *("double", "float", "int64", "uint64", "int32", "bool", "string", "bytes", "uint32", "sint64"),
)


def build_messages(package: str, schema: str) -> dict[str, Any]:
    """The message classes of a schema, by name.

    Args:
        package: of the messages, such as `osi3`; it is part of their full names.
    """
    pool = _load("descriptor_pool").DescriptorPool()
    pool.Add(describe_file(package, schema))
    file = pool.FindFileByName(f"{package}.proto")
    return {
        name: _load("message_factory").GetMessageClass(message)
        for name, message in file.message_types_by_name.items()
    }


def describe_file(package: str, schema: str) -> Any:
    """The schema as the FileDescriptorProto that protobuf and MCAP know."""
    kinds = _load("descriptor_pb2").FieldDescriptorProto
    file = _load("descriptor_pb2").FileDescriptorProto(
        name=f"{package}.proto", package=package, syntax="proto2"
    )
    for line in filter(None, map(str.strip, schema.splitlines())):
        name, _, fields = line.partition(":")
        message = file.message_type.add(name=name.strip())
        for text in filter(None, map(str.strip, fields.split(","))):
            label, number, kind = text.split()
            is_repeated, is_packed, kind = kind[0] in "*+", kind[0] == "+", kind.lstrip("*+")
            field = message.field.add(
                name=label,
                number=int(number),
                label=kinds.LABEL_REPEATED if is_repeated else kinds.LABEL_OPTIONAL,
            )
            if is_packed:
                field.options.packed = True
            if kind in _SCALARS:
                field.type = getattr(kinds, f"TYPE_{kind.upper()}")
            else:
                field.type = kinds.TYPE_MESSAGE
                field.type_name = f".{package}.{kind}"
    return file
