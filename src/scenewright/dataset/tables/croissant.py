"""croissant.json: the tables of a dataset in MLCommons' Croissant 1.0, which loaders read."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

from scenewright.dataset.tables.parquet import SCHEMAS

_CONTEXT: Mapping[str, Any] = json.loads(
    resources.files("scenewright.dataset.tables")
    .joinpath("croissant_context.json")
    .read_text("utf-8")
)
"""The JSON-LD context that version 1.0 of the format prescribes."""
_TYPES = {
    "string": "sc:Text", "list": "sc:Text", "bool": "sc:Boolean", "int64": "sc:Integer",
    "int32": "sc:Integer", "int16": "sc:Integer", "ids": "sc:Integer", "float64": "sc:Float",
    "float32": "sc:Float", "floats": "sc:Float",
}  # fmt: skip
_LISTS = ("list", "ids", "floats")


def describe_in_croissant(
    *, name: str, description: str, licence: str, version: str, tables: Sequence[str]
) -> bytes:
    """The file's bytes.

    Args:
        licence: address of the licence's text; version: of scenewright.
        tables: those that have rows.
    """
    value = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": name,
        "description": description,
        "license": licence,
        "citeAs": f"The scenewright contributors: {name}. Made with scenewright {version}.",
        "version": version,
        "isLiveDataset": False,
        "distribution": [
            {
                "@type": "cr:FileSet",
                "@id": f"files-of-{table}",
                "name": f"files-of-{table}",
                "encodingFormat": "application/x-parquet",
                "includes": f"tables/{table}/*.parquet",
            }
            for table in tables
        ],
        "recordSet": [
            {"@type": "cr:RecordSet", "@id": table, "name": table,
             "field": [_describe_field(table, column) for column in SCHEMAS[table]]}
            for table in tables
        ],
    }  # fmt: skip
    return (json.dumps(value, ensure_ascii=False, indent=1) + "\n").encode("utf-8")


def _describe_field(table: str, column: str) -> dict[str, Any]:
    kind, meaning = SCHEMAS[table][column]
    extract = {"fileSet": {"@id": f"files-of-{table}"}, "extract": {"column": column}}
    found = {
        "@type": "cr:Field",
        "@id": f"{table}/{column}",
        "name": column,
        "description": meaning,
        "dataType": _TYPES[kind],
        "source": extract,
    }
    return found | {"repeated": True} if kind in _LISTS else found
