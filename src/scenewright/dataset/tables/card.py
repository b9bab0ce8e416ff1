"""The card of a dataset, README.md, and croissant.json, MLCommons' Croissant 1.0 for loaders."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from typing import Any

import numpy as np

from scenewright.dataset.tables.coverage import Covered, measure_coverage
from scenewright.dataset.tables.markdown import escape_markdown, format_table
from scenewright.dataset.tables.parquet import SCHEMAS, TABLES
from scenewright.dataset.tables.tally import Tally

LICENCE = "apache-2.0"
ABSTRACT = (
    "Traffic scenes at an intersection, each made from an instruction in plain language by "
    "scenewright and checked on its final tracks. Tracks are simulated; no person was recorded."
)
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


def format_card(
    tally: Tally,
    *,
    title: str,
    given: int,
    splits: Mapping[str, Sequence[str]],
    about: Mapping[str, Any],
    pictures: tuple[str, str],
) -> str:
    """The card as Markdown, with the front matter by which `datasets` finds the tables.

    Args:
        given: instructions in all; splits: table -> those that have rows.
        about: how the dataset was made; pictures: paths of the two pictures, below the card.
    """
    where, how = pictures
    percentiles = (
        (escape_markdown(name), str(len(values)),
         "{:.2f} / {:.2f} / {:.2f}".format(*np.percentile(np.array(values), (5, 50, 95))))
        for name, values in sorted(tally.figures.items())
    )  # fmt: skip
    parts = [
        _format_front_matter(title, tally.tables["scenes"], splits),
        f"# {escape_markdown(title)}",
        ABSTRACT,
        f"![Where and when events happen, and how many agents there are]({where})",
        _format_counts("In figures", _list_figures(tally, given), "figure", "value"),
        _format_events(tally.events),
        _format_causes(tally.causes),
        _format_table(
            "## What the scenes show", ("figure", "values", "5 % / median / 95 %"), percentiles
        ),
        f"![How close events are, how fast agents move, how many are seen]({how})",
        _format_coverage(measure_coverage(tally.encounters)),
        _format_counts("Leaves of the taxonomy", tally.patterns, "pattern", "scenes"),
        _format_counts("Without a scene", tally.codes, "reason", "instructions"),
        _read_part("card_layout.md"),
        *(_format_schema(name, tally.tables[name]) for name in TABLES),
        _format_counts("How it was made", _flatten(about), "option", "value"),
        _read_part("card_licence.md"),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _list_figures(tally: Tally, given: int) -> dict[str, Any]:
    sizes = np.array([n for n, times in sorted(tally.agents.items()) for _ in range(times)])
    return {
        "instructions given": given,
        "scenes made": tally.statuses["made"],
        **{f"instructions {status}": tally.statuses[status] for status in ("refused", "failed")},
        **{f"scenes at {place}": n for place, n in sorted(tally.intersections.items())},
        "scenes verified": tally.verdicts["verified"],
        "scenes verified in part, without all words": tally.verdicts["partly"],
        "words not shown, those of most scenes": ", ".join(
            repr(words) for words, _ in tally.unshown.most_common(12)
        )
        or "none",
        "scenes with a red light run unasked": tally.unlawful,
        "scenes whose pair is closer or faster to a contact at another moment": tally.worse,
        "agents per scene, least, median, most": "–"
        if not len(sizes)
        else f"{sizes.min()}, {float(np.median(sizes)):g}, {sizes.max()}",
    }


def _format_front_matter(title: str, scenes: int, splits: Mapping[str, Sequence[str]]) -> str:
    from huggingface_hub import DatasetCardData

    size = next((name for most, name in _SIZES if scenes < most), "n>1M")
    data = DatasetCardData(
        license=LICENCE,
        pretty_name=escape_markdown(title),
        language=["en"],
        size_categories=[size],
        tags=["traffic", "trajectories", "synthetic", "safety-critical events"],
        configs=[
            {"config_name": name, **({"default": True} if name == "scenes" else {}),
             "data_files": [{"split": split, "path": f"tables/{name}/{split}.parquet"}
                            for split in there]}
            for name, there in splits.items()
        ],
    )  # fmt: skip
    return f"---\n{data.to_yaml()}\n---"


def _format_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table under its title; nothing without a row."""
    listed = list(rows)
    return f"{title}\n\n{format_table(columns, listed)}" if listed else ""


def _format_counts(title: str, counts: Mapping[str, Any], name: str, value: str) -> str:
    ordered = list(counts.items())
    if all(isinstance(count, int) for count in counts.values()):
        ordered.sort()
    rows = [[escape_markdown(str(cell)) for cell in pair] for pair in ordered]
    return _format_table(f"## {title}", (name, value), rows)


def _format_events(events: Mapping[tuple[str, str], int]) -> str:
    """A row for each type of event; what was asked for stands apart from what happened beside."""
    columns = ("asked for", "unasked", "incidental")
    rows = [
        (escape_markdown(kind), *(str(events.get((kind, how), 0)) for how in columns))
        for kind in sorted({kind for kind, _ in events})
    ]
    return _format_table("## Events in scenes", ("event", *columns), rows)


def _format_causes(causes: Mapping[tuple[str, str], int]) -> str:
    """Why the events that were asked for came about, with the share among those of their type."""
    totals = Counter[str]()
    for (kind, _), count in causes.items():
        totals[kind] += count
    rows = [
        (escape_markdown(kind), escape_markdown(cause), str(count),
         f"{100 * count / totals[kind]:.0f} %")
        for (kind, cause), count in sorted(causes.items())
    ]  # fmt: skip
    columns = ("event", "cause", "events", "share")
    return _format_table("## Causes of the events asked for", columns, rows)


def _format_coverage(covered: Sequence[Covered]) -> str:
    """What `scenewright coverage` tells of the scenes that are verified."""
    cells = []
    for each in covered:
        met = ", ".join(f"{' and '.join(bin_)} ({n})" for bin_, n in each.counts.items() if n)
        empty = ", ".join(map(" and ".join, each.gaps)) or "none"
        share = f"{each.wanted - len(each.gaps)} of {each.wanted}"
        cells.append((f"`{each.name}`", share, *map(escape_markdown, (met, empty))))
    columns = ("item", "bins", "encounters", "empty bins")
    return _format_table("## Coverage", columns, cells)


def _format_schema(name: str, rows: int) -> str:
    kinds = {"list": "list of string", "ids": "list of int16", "floats": "list of float64"}
    cells = [
        (f"`{column}`", kinds.get(kind, kind), meaning)
        for column, (kind, meaning) in SCHEMAS[name].items()
    ]
    return _format_table(f"### Table `{name}`: {rows} rows", ("column", "type", "meaning"), cells)


def _flatten(about: Mapping[str, Any]) -> dict[str, Any]:
    """Nested options side by side, as strings."""
    found: dict[str, Any] = {}
    for key, value in about.items():
        if isinstance(value, Mapping):
            found.update({f"{key}: {inner}": str(each) for inner, each in value.items()})
        elif value is not None:
            found[key] = str(value)
    return found


def _read_part(name: str) -> str:
    """A file of this room, without the newline at its end."""
    return resources.files(__package__).joinpath(name).read_text("utf-8").rstrip()


_TYPES = {
    "string": "sc:Text", "list": "sc:Text", "bool": "sc:Boolean", "int64": "sc:Integer",
    "int32": "sc:Integer", "int16": "sc:Integer", "ids": "sc:Integer", "float64": "sc:Float",
    "float32": "sc:Float", "floats": "sc:Float",
}  # fmt: skip
_LISTS = ("list", "ids", "floats")


def describe_in_croissant(*, name: str, version: str, tables: Sequence[str]) -> bytes:
    """The file's bytes.

    Args:
        version: of scenewright; tables: those that have rows.
    """
    value = {
        "@context": json.loads(_read_part("croissant_context.json")),  # as version 1.0 has it
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": name,
        "description": ABSTRACT,
        "license": "https://www.apache.org/licenses/LICENSE-2.0",
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
