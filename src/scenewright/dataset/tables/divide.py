"""A dataset's tables divided into train, validation and test, as `datasets` loads them."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from scenewright.dataset.tables.parquet import TABLES, build_arrow_schema, import_parquet
from scenewright.dataset.tables.splits import SPLITS, Split
from scenewright.errors import InputError

_AT_ONCE = 50_000
"""Rows that are held in memory."""


def divide_tables(folder: Path, out: Path) -> dict[Split, int]:
    """Writes OUT/SPLIT/TABLE.parquet for every table and split, and a card; scenes per split.

    The table `map` goes to each split whole.

    Raises:
        InputError: no tables, or `out` holds something.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} is there already; name a folder that does not exist")
    missing = [name for name in TABLES if not (folder / f"tables/{name}.parquet").is_file()]
    if missing:
        raise InputError(
            f"{folder} has no table {missing[0]}; make the tables anew with scenewright batch"
        )
    part = out.with_name(f".{out.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    belongs, counts = _assign_rows(folder)
    for split in SPLITS:
        (part / split).mkdir(parents=True)
    there = {name: _divide(folder, part, name, belongs) for name in TABLES}
    (part / "README.md").write_text(_format_card(counts, there), encoding="utf-8")
    out.parent.mkdir(parents=True, exist_ok=True)
    if out.exists():
        out.rmdir()
    part.rename(out)
    return {split: counts[split] for split in SPLITS}


def _read(folder: Path, name: str, **options: Any) -> Iterator[Any]:
    file = import_parquet().ParquetFile(folder / f"tables/{name}.parquet")
    yield from file.iter_batches(batch_size=_AT_ONCE, **options)


def _assign_rows(folder: Path) -> tuple[dict[str, Split], Counter[Split]]:
    """The split of every row, and how many scenes each has."""
    belongs: dict[str, Split] = {}
    counts: Counter[Split] = Counter()
    for batch in _read(folder, "scenes", columns=["row", "status", "split"]):
        for row in batch.to_pylist():
            belongs[row["row"]] = row["split"]
            counts[row["split"]] += row["status"] == "made"
    return belongs, counts


def _divide(folder: Path, part: Path, name: str, belongs: Mapping[str, Split]) -> list[Split]:
    """Writes one table's files; the splits that have rows of it."""
    schema = build_arrow_schema(name)
    writers = {
        split: import_parquet().ParquetWriter(
            part / split / f"{name}.parquet", schema, compression="zstd"
        )
        for split in SPLITS
    }
    found: Counter[Split] = Counter()
    for batch in _read(folder, name):
        rows_of_split = (
            None if name == "map" else [belongs[row] for row in batch["row"].to_pylist()]
        )
        for split, writer in writers.items():
            chosen = (
                batch
                if rows_of_split is None
                else batch.filter([each == split for each in rows_of_split])
            )
            found[split] += len(chosen)
            if len(chosen):
                writer.write_batch(chosen.cast(schema))
    for writer in writers.values():
        writer.close()
    return [split for split in SPLITS if found[split]]


def _format_card(counts: Mapping[Split, int], there: Mapping[str, list[Split]]) -> str:
    """Front matter by which `load_dataset(OUT)` finds splits; `scenes` is what it loads unasked.

    A split without rows is not named, as `datasets` refuses empty ones.
    """
    lines = ["---", "configs:"]
    for name, splits in there.items():
        lines += [f"- config_name: {name}", *(["  default: true"] if name == "scenes" else [])]
        lines.append("  data_files:")
        for split in splits:
            lines += [f"  - split: {split}", f"    path: {split}/{name}.parquet"]
    counted = ", ".join(f"{counts[split]} in {split}" for split in SPLITS)
    return "\n".join(
        [*lines, "---", "", f"Scenes: {counted}.  Made by `scenewright dataset split`.", ""]
    )
