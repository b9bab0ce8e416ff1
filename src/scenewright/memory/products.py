"""What a version is built on, as bytes: arrays exactly, everything else as plain JSON.

Nothing is pickled and no class is named in the bytes: a forged file can hold values, and
values alone.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.behavior import Segment
from scenewright.scene.candidates import AssignedPattern, Candidate, DrivingProfile, Path
from scenewright.scene.frozen_agents import PreviousAgent, PreviousVersion
from scenewright.scene.map import Route
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.selection import PlannedEvent, Push, SelectedAgent, Slowing, Stop
from scenewright.scene.track import Shape, Track

_VERSION = 1


def serialize_version(earlier: PreviousVersion) -> bytes:
    """The products, so that `deserialize_version` gives the same to the last bit."""
    value = {
        "version": _VERSION,
        "hour": earlier.hour,
        "duration": earlier.duration,
        "signal_offset": earlier.signal_offset,
        "events": [asdict(each) for each in earlier.events],
        "patterns": [each.model_dump(mode="json") for each in earlier.patterns],
        "agents": [_serialize_agent(each) for each in earlier.agents.values()],
        **(
            {"objects": [each.model_dump(mode="json") for each in earlier.objects]}
            if earlier.objects
            else {}
        ),
    }
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return zlib.compress(text.encode(), level=1)


def deserialize_version(data: bytes) -> PreviousVersion:
    """The products that were written.

    Raises:
        InputError: these are no such bytes.
    """
    try:
        value = json.loads(zlib.decompress(data))
        if value["version"] != _VERSION:
            raise InputError(
                f"a version of format {value['version']}, not {_VERSION}, is kept here"
            )
        agents = [_read_agent(each) for each in value["agents"]]
        return PreviousVersion(
            agents={each.agent.name: each for each in agents},
            patterns=tuple(AssignedPattern.model_validate(each) for each in value["patterns"]),
            hour=float(value["hour"]),
            duration=float(value["duration"]),
            signal_offset=_parse_optional(value["signal_offset"]),
            events=tuple(_read_event(each) for each in value["events"]),
            objects=tuple(ObjectRecord.model_validate(each) for each in value.get("objects", ())),
        )
    except (zlib.error, ValueError, KeyError, TypeError, IndexError) as error:
        raise InputError(f"a kept version cannot be read: {error}") from error


def _serialize_agent(each: PreviousAgent) -> dict[str, Any]:
    agent, candidate = each.agent, each.agent.candidate
    law = asdict(candidate.time_law)
    if not law["pace"]:  # then as before there was one
        del law["pace"]
    return {
        "number": each.number,
        "name": agent.name,
        "role": agent.role,
        "index": agent.index,
        "enters": agent.enters,
        "stops": [asdict(stop) for stop in agent.stops],
        "slowings": [asdict(slowing) for slowing in agent.slowings],
        "contact": agent.contact,
        "violates": agent.violates,
        "push": None if agent.push is None else asdict(agent.push),
        "segments": [segment.model_dump(mode="json") for segment in each.segments],
        "track": {
            "xy": _serialize_array(each.track.xy),
            "heading": _serialize_array(each.track.heading),
            "start": each.track.start,
            "step": each.track.step,
        },
        "candidate": {
            "route": candidate.route.model_dump(mode="json"),
            "waypoints": _serialize_array(candidate.waypoints),
            "path": _write_path(candidate.path),
            "nll": candidate.nll,
            "time_law": law,
            "time_nll": candidate.time_nll,
            "shape": asdict(candidate.shape),
            "subtype": candidate.subtype,
            **({} if candidate.unevaded is None else {"unevaded": _write_path(candidate.unevaded)}),
        },
    }


def _read_agent(value: Mapping[str, Any]) -> PreviousAgent:
    track = value["track"]
    role = value["role"]
    if role not in ("foreground", "background"):
        raise ValueError(f"there is no role {role!r}")
    return PreviousAgent(
        number=int(value["number"]),
        agent=SelectedAgent(
            name=str(value["name"]),
            role=role,
            candidate=_read_candidate(value["candidate"]),
            index=int(value["index"]),
            enters=float(value["enters"]),
            stops=tuple(Stop(**each) for each in value["stops"]),
            slowings=tuple(Slowing(**each) for each in value["slowings"]),
            contact=_parse_optional(value["contact"]),
            violates=bool(value["violates"]),
            push=None if value.get("push") is None else Push(**value["push"]),
        ),
        segments=tuple(Segment.model_validate(each) for each in value["segments"]),
        track=Track(
            _read_array(track["xy"]), _read_array(track["heading"]), track["start"], track["step"]
        ),
    )


def _write_path(path: Path) -> list[Any]:
    return [_serialize_array(each) for each in (path.xy, path.s, path.heading, path.curvature)]


def _read_path(value: Sequence[Any]) -> Path:
    xy, s, heading, curvature = (_read_array(each) for each in value)
    return Path(xy, s, heading, curvature)


def _read_candidate(value: Mapping[str, Any]) -> Candidate:
    law = value["time_law"]
    return Candidate(
        route=Route.model_validate(value["route"]),
        waypoints=_read_array(value["waypoints"]),
        path=_read_path(value["path"]),
        nll=float(value["nll"]),
        time_law=DrivingProfile(**{**law, "pace": tuple(law.get("pace", ()))}),
        time_nll=float(value["time_nll"]),
        shape=Shape(**value["shape"]),
        subtype=value["subtype"],
        unevaded=_read_path(value["unevaded"]) if "unevaded" in value else None,
    )


def _read_event(value: Mapping[str, Any]) -> PlannedEvent:
    first, second = value["agents"]
    x, y = value["location"]
    return PlannedEvent(value["clause"], (first, second), float(value["time"]), (x, y))


def _serialize_array(values: FloatArray) -> dict[str, Any]:
    exact = np.ascontiguousarray(values, dtype="<f8")
    return {"shape": list(exact.shape), "f8": base64.b64encode(exact.tobytes()).decode()}


def _read_array(value: Mapping[str, Any]) -> FloatArray:
    flat = np.frombuffer(base64.b64decode(value["f8"], validate=True), dtype="<f8")
    return np.array(flat.reshape(value["shape"]), dtype=np.float64)


def _parse_optional(value: Any) -> float | None:
    return None if value is None else float(value)
