"""Scenes as Parquet tables: scenes, agents, tracks, events, account, lights, map, refused.

A table is a folder with a file for each split that has rows of it, as `datasets` loads them.

Rows are written in the order in which scenes are added, in groups of the same size, so the same
scenes give the same bytes (for one version of pyarrow). pyarrow loads on first use.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module, resources
from pathlib import Path
from typing import Any, Self, get_args

import numpy as np

from scenewright.dataset.tables.splits import SPLITS, Split
from scenewright.extras import require_extra
from scenewright.geometry.kinematics import differentiate
from scenewright.intersections import load_map
from scenewright.scene.base import AgentClass, Point
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.phrasing import call_agents
from scenewright.scene.record import SceneRecord
from scenewright.scene.track import VEHICLE_SIZES

TABLES = ("scenes", "agents", "tracks", "events", "account", "lights", "map", "refused")
_GROUP = {
    "scenes": 2_000, "agents": 10_000, "tracks": 120_000, "events": 10_000, "account": 10_000,
    "lights": 20_000, "map": 2_000, "refused": 2_000,
}  # fmt: skip
"""Rows of a row group: what is held in memory before it is written."""

Fields = Mapping[str, tuple[str, str]]
"""Column -> (type, meaning)."""

SCHEMAS: Mapping[str, Fields] = {
    table: {
        name: (kind, meaning.replace("{subtypes}", ", ".join(VEHICLE_SIZES)))
        for name, (kind, meaning) in columns.items()
    }
    for table, columns in tomllib.loads(
        resources.files("scenewright.dataset.tables").joinpath("columns.toml").read_text("utf-8")
    ).items()
}
"""All tables with their columns."""


@dataclass(frozen=True)
class SceneFiles:
    """One row of a dataset: what is known without a scene, and its files if there is one.

    Attributes:
        about: columns of `scenes` or `refused` that do not come from the files.
        scene, proof, provenance: what the files of those names hold.
    """

    about: Mapping[str, Any]
    scene: Mapping[str, Any] | None = None
    proof: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] | None = None

    @classmethod
    def read(cls, out: Path, about: Mapping[str, Any]) -> Self:
        """The files in the folder that `about` names, below the dataset's, if it names one."""
        if about.get("folder") is None:
            return cls(about)
        place, names = out / about["folder"], ("scene", "proof", "provenance")
        return cls(about, *(json.loads((place / f"{name}.json").read_bytes()) for name in names))


def build_rows(files: SceneFiles) -> dict[str, Any]:
    """Rows of each table for one row of the dataset; those of `tracks` as lists by column."""
    if files.scene is None or files.proof is None:
        return {name: [] for name in TABLES} | {"refused": [files.about], "tracks": {}}
    row, scene = files.about["row"], files.scene
    called = call_agents(SceneRecord.model_validate(scene))
    return {
        "scenes": [_build_scene_row(files)],
        "agents": [
            _build_agent_row(row, agent, scene["meta"]["step"]) | {"called": called[agent["id"]]}
            for agent in scene["agents"]
        ],
        "tracks": _build_track_rows(row, scene),
        "events": list(build_event_rows(row, scene, files.proof)),
        # Proofs of earlier versions have no account.
        "account": [{"row": row, **entry} for entry in files.proof.get("account", ())],
        "lights": [{"row": row, **light} for light in scene["signals"] or ()],
        "map": [],
        "refused": [],
    }


_OF_META = (
    "intersection", "scene_id", "time_of_day", "timestamp", "density", "duration", "step",
)  # fmt: skip


def _build_scene_row(files: SceneFiles) -> dict[str, Any]:
    scene, about = files.scene or {}, files.provenance or {}
    meta, agents = scene["meta"], scene["agents"]
    proof = Proof.model_validate(files.proof)
    return {
        **files.about,
        **{key: meta[key] for key in _OF_META},
        "refiner": about.get("refiner"),
        "selection": about.get("selection"),
        "patterns": list(about.get("patterns", [])),
        "verified": proof.verified,
        "verdict": proof.verdict,
        "not_shown": [word.words for word in proof.list_words("not_shown")],
        "unasked_red_lights": proof.unasked_red_lights,
        "relations": [each["type"] for each in scene["relations"]],
        **{
            f"{kind}s": sum(agent["type"] == kind for agent in agents)
            for kind in get_args(AgentClass)
        },
        **{
            role: sum(agent["role"] == role for agent in agents)
            for role in ("foreground", "background")
        },
        "objects": _format_json(scene["objects"]) if scene.get("objects") else None,
    }


def _build_agent_row(row: str, agent: Mapping[str, Any], step: float) -> dict[str, Any]:
    same = ("name", "type", "subtype", "role", "entry", "exit", "movement", "crosswalk", "route",
            "length", "width", "violates_signal")  # fmt: skip
    start = agent["spawn_time"]
    return {
        "row": row,
        "agent": agent["id"],
        **{key: agent[key] for key in same},
        **{key: agent.get(key) for key in ("reaction", "motion", "group")},
        "start": start,
        "end": round(start + step * (len(agent["trajectory"]) - 1), 3),
        "goal_x": agent["goal"][0],
        "goal_y": agent["goal"][1],
        "segments": _format_json(agent["segments"]),
    }


def _build_track_rows(row: str, scene: Mapping[str, Any]) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {name: [] for name in SCHEMAS["tracks"]}
    step = scene["meta"]["step"]
    for agent in scene["agents"]:
        places, start = agent["trajectory"], agent["spawn_time"]
        velocity = differentiate(np.array(places, dtype=np.float64), step)
        acceleration = differentiate(velocity, step)
        columns["agent"] += [agent["id"]] * len(places)
        columns["time"] += [round(start + step * k, 3) for k in range(len(places))]
        columns["x"] += [place[0] for place in places]
        columns["y"] += [place[1] for place in places]
        columns["heading"] += agent["heading"]
        for names, values in ((("vx", "vy"), velocity), (("ax", "ay"), acceleration)):
            for name, column in zip(names, values.T, strict=True):
                columns[name] += column.round(3).tolist()
    columns["row"] = [row] * len(columns["agent"])
    return columns


def build_event_rows(
    row: str, scene: Mapping[str, Any], proof: Mapping[str, Any]
) -> Iterator[dict[str, Any]]:
    """The scene's events with what the checker measured, then the incidental ones."""
    asked = {(each["type"], each["from"], each["to"]) for each in scene["relations"]}
    same = ("type", "from", "to", "time")
    measured = {tuple(each[key] for key in same): each for each in proof["events"]}
    seen = [(each, measured.get(tuple(each[key] for key in same), {})) for each in scene["events"]]
    for event, proven in (*seen, *((each, each) for each in proof["incidental"])):
        ends, incidental = (event["from"], event["to"]), event is proven
        x, y = event["location"] or (None, None)
        yield {
            "row": row, "x": x, "y": y, "incidental": incidental,
            "asked": not incidental
            and not asked.isdisjoint({(event["type"], *ends), (event["type"], *ends[::-1])}),
            **{key: event[key] for key in (*same, "kind", "cause")},
            "queue": incidental and event["type"] == "follow",
            "evidence": _format_json(proven.get("evidence", {})),
            **{key: _format_json(proven[key]) for key in ("when", "worst") if key in proven},
        }  # fmt: skip


def _format_json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


class TableWriter:
    """Writes the tables to a folder, group by group; `map` has each place once in a split."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._parts: dict[tuple[str, Split], _Part] = {}
        self._maps: set[tuple[str, Split]] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for part in self._parts.values():
            part.close()

    def add(self, files: SceneFiles) -> dict[str, Any]:
        """Adds one row of the dataset; the rows that each table got, see `build_rows`."""
        rows, split = build_rows(files), files.about["split"]
        if files.scene is not None:
            place = files.scene["meta"]["intersection"]
            if (place, split) not in self._maps:
                self._maps.add((place, split))
                rows["map"] = list_map_rows(load_map(place))
        for name in (name for name in TABLES if rows[name]):
            if (name, split) not in self._parts:
                path = self._folder / name / f"{split}.parquet"
                path.parent.mkdir(exist_ok=True)
                self._parts[name, split] = _Part(path, name)
            self._parts[name, split].add(rows[name])
        return rows


def list_table_files(folder: Path, name: str) -> list[Path]:
    """The files of a table that there are, below the folder of all tables."""
    files = (folder / name / f"{split}.parquet" for split in SPLITS)
    return [file for file in files if file.is_file()]


def read_table(folder: Path, name: str, columns: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The rows of a table, split after split; columns that a file lacks are left out."""
    for path in list_table_files(folder, name):
        file = import_parquet().ParquetFile(path)
        known = [column for column in columns if column in file.schema_arrow.names]
        for batch in file.iter_batches(batch_size=500, columns=known):
            yield from batch.to_pylist()


class _Part:
    """One table: rows that wait until they fill a group, and the file that takes them."""

    def __init__(self, path: Path, name: str) -> None:
        self._group, self._schema = _GROUP[name], build_arrow_schema(name)
        self._writer = import_parquet().ParquetWriter(path, self._schema, compression="zstd")
        self._waiting = self._schema.empty_table()

    def add(self, rows: list[dict[str, Any]] | dict[str, list[Any]]) -> None:
        arrow = import_module("pyarrow")
        read = arrow.table if isinstance(rows, dict) else arrow.Table.from_pylist
        self._waiting = arrow.concat_tables([self._waiting, read(rows, schema=self._schema)])
        while self._waiting.num_rows >= self._group:
            self._write()

    def close(self) -> None:
        if self._waiting.num_rows:
            self._write()
        self._writer.close()

    def _write(self) -> None:
        full = self._waiting.slice(0, self._group).combine_chunks()
        self._writer.write_table(full, row_group_size=self._group)
        self._waiting = self._waiting.slice(self._group)


def require_tables() -> None:
    """Raise InputError unless the package is there by which a dataset's tables are written."""
    require_extra("tables", "a dataset", "pyarrow")


def import_parquet() -> Any:
    """pyarrow's module for Parquet files, which has no types of its own."""
    return import_module("pyarrow.parquet")


def build_arrow_schema(name: str) -> Any:
    """The schema of a table as pyarrow has it, with each column's meaning."""
    pa, lists = import_module("pyarrow"), {"list": "string", "ids": "int16", "floats": "float64"}
    fields = [
        pa.field(
            key,
            pa.list_(pa.type_for_alias(lists[kind])) if kind in lists else pa.type_for_alias(kind),
            metadata={"meaning": meaning},
        )
        for key, (kind, meaning) in SCHEMAS[name].items()
    ]
    return pa.schema(fields)


def list_map_rows(intersection: IntersectionMap) -> list[dict[str, Any]]:
    """The rows of one intersection, in the order of its map file.

    An area has its rim; holes are rows of their own, with the area's id and a number.
    """
    roads: dict[str | None, str] = {leg.name: leg.road for leg in intersection.legs}

    def build(
        feature: str, kind: str, points: Sequence[Point], leg: str | None = None, **more: Any
    ) -> dict[str, Any]:
        places = {"x": [point[0] for point in points], "y": [point[1] for point in points]}
        own = {"intersection": intersection.name, "feature": feature, "kind": kind, "leg": leg}
        return {**own, "road": roads.get(leg), **places, **more}

    rows = [
        build(lane.id, lane.kind, lane.centreline, lane.leg, width=lane.width,
              speed_limit=lane.speed_limit, successors=list(lane.successors))
        for lane in intersection.lanelets
    ]  # fmt: skip
    rows += [build(line.id, "stop_line", line.line, line.leg) for line in intersection.stop_lines]
    rows += [
        build(walk.id, "crosswalk", walk.centreline, walk.leg, width=walk.width)
        for walk in intersection.crosswalks
    ]
    for kind, areas in (("road", intersection.road), ("walkable", intersection.walkable)):
        for number, area in enumerate(areas, start=1):
            name = f"{kind}-{number}"
            rows.append(build(name, kind, area.exterior))
            rows += [build(f"{name}:hole-{hole}", f"{kind}_hole", rim)
                     for hole, rim in enumerate(area.holes, start=1)]  # fmt: skip
    return rows
