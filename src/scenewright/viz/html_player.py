"""A scene as one HTML file: player, timeline, proof, account of words; it needs no network."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable
from functools import lru_cache
from html import escape
from importlib.resources import files
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.phrasing import speak_plainly
from scenewright.scene.record import NEXT_TEXT, SceneRecord
from scenewright.viz.appearance import (
    DrawnMotion,
    choose_view,
    describe_object,
    find_main_time,
    is_night,
    list_motions,
    make_printable,
    outline_object,
)
from scenewright.viz.road_markings import (
    build_crosswalk_bars,
    find_light_positions,
    find_painted_bounds,
)

_TITLE, _STYLE, _SCRIPT, _DATA, _POLICY = (
    f"@@{name}@@" for name in ("TITLE", "STYLE", "SCRIPT", "DATA", "POLICY")
)


def write_player(
    path: str | Path, *, scene: SceneRecord, proof: Proof | None, intersection: IntersectionMap
) -> None:
    """Write a scene as one self-contained HTML file.

    Raises:
        InputError: the scene holds numbers that are not finite, or the file cannot be written;
            nothing is left behind.
    """
    page = build_player(scene=scene, proof=proof, intersection=intersection)
    write_atomically(path, page.encode())


def build_player(
    *,
    scene: SceneRecord,
    proof: Proof | None,
    intersection: IntersectionMap,
    over: SceneRecord | None = None,
) -> str:
    """The page as text; its policy forbids every request and every script but its own.

    Args:
        over: another version of the scene, whose agents are drawn as outlines where they differ.
    """
    script, style = _read_part("player.js"), _read_part("player.css")
    data = build_player_data(scene=scene, proof=proof, intersection=intersection)
    data["over"] = [] if over is None else _describe_others(scene, over)
    values = {
        _TITLE: escape(make_printable(scene.meta.user_prompt, limit=120) or "Untitled scene"),
        _POLICY: f"default-src 'none'; style-src '{_hash_source(style)}'; "
        f"script-src '{_hash_source(script)}'; img-src data:; base-uri 'none'; form-action 'none'",
        _STYLE: style,
        _SCRIPT: script,
        _DATA: encode_for_script(data),
    }
    # The template with each mark replaced once; text that was put in is not looked at again.
    template = _read_part("player.html")
    for mark in values:
        if template.count(mark) != 1:
            raise ValueError(f"the page has {mark} {template.count(mark)} times")
    places = sorted((template.index(mark), mark) for mark in values)
    parts, at = [], 0
    for start, mark in places:
        parts += [template[at:start], values[mark]]
        at = start + len(mark)
    return "".join([*parts, template[at:]])


def build_player_data(
    *, scene: SceneRecord, proof: Proof | None, intersection: IntersectionMap
) -> dict[str, Any]:
    """What the player draws, as plain JSON values: metres to 0.01, seconds, radians to 0.001."""
    moving = list_motions(scene)
    return {
        "meta": scene.meta.model_dump(mode="json"),
        "view": choose_view(scene, moving, intersection),
        "night": is_night(scene),
        "mainTime": find_main_time(scene),
        "map": _describe_map(intersection),
        "agents": [_describe_agent(each) for each in moving],
        "objects": [
            {
                "name": describe_object(scene_object),
                "high": scene_object.height == "high",
                "since": scene_object.since or 0.0,
                "outline": _round(outline_object(scene_object)),
            }
            for scene_object in scene.objects
        ],
        "signals": [signal.model_dump(mode="json") for signal in scene.signals],
        "events": _list_events(scene, proof, intersection),
        "proof": None if proof is None else _describe_proof(proof),
        "account": [] if proof is None else _list_words(scene, proof),
    }


def encode_for_script(data: Any) -> str:
    """JSON in ASCII that cannot end the script element that holds it.

    Raises:
        InputError: a number is not finite.
    """
    try:
        text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    except ValueError as error:
        raise InputError("the scene holds numbers that are not finite") from error
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return text


def _describe_map(intersection: IntersectionMap) -> dict[str, Any]:
    paint = find_painted_bounds(intersection)
    return {
        "name": intersection.name,
        "title": intersection.title,
        "extent": intersection.extent,
        "road": [_list_rings(area.exterior, area.holes) for area in intersection.road],
        "walkable": [_list_rings(area.exterior, area.holes) for area in intersection.walkable],
        "bars": [
            _round(bar) for walk in intersection.crosswalks for bar in build_crosswalk_bars(walk)
        ],
        "paint": {kind: [_round(line) for line in lines] for kind, lines in paint.items()},
        "stopLines": [_round(line.line) for line in intersection.stop_lines],
        "lights": {name: _round(at) for name, at in find_light_positions(intersection).items()},
        "legs": [{"name": leg.name, "road": leg.road, "bearing": leg.bearing}
                 for leg in intersection.legs],
    }  # fmt: skip


def _list_rings(exterior: ArrayLike, holes: Iterable[ArrayLike]) -> list[Any]:
    return [_round(ring) for ring in (exterior, *holes)]


def _describe_agent(motion: DrawnMotion) -> dict[str, Any]:
    agent = motion.agent
    return {
        **agent.model_dump(
            mode="json",
            include={"id", "name", "type", "subtype", "role", "entry", "exit", "movement",
                     "crosswalk", "length", "width"},
        ),
        "segments": [segment.model_dump(mode="json") for segment in agent.segments],
        "called": motion.called,
        "colour": motion.colour,
        "start": float(motion.times[0]),
        "stays": motion.stays,
        "xy": _round(motion.xy),
        "heading": _round(motion.heading, 3),
        "speed": _round(motion.speed),
    }  # fmt: skip


def _describe_others(scene: SceneRecord, over: SceneRecord) -> list[dict[str, Any]]:
    """The agents of another version whose tracks are not in this one."""
    here = {(agent.name, agent.spawn_time, agent.trajectory) for agent in scene.agents}
    return [
        _describe_agent(motion)
        for motion in list_motions(over)
        if (motion.agent.name, motion.agent.spawn_time, motion.agent.trajectory) not in here
    ]


def _list_events(
    scene: SceneRecord, proof: Proof | None, intersection: IntersectionMap
) -> list[dict[str, Any]]:
    """Events with their evidence, and the conflict zone of the two routes where the map has one."""
    routes = {agent.id: agent.route for agent in scene.agents}
    rows = [event.model_dump(mode="json", by_alias=True) for event in (proof or scene).events]
    return [
        {**row, "zone": _find_zone(intersection, routes.get(row["from"]), routes.get(row["to"]))}
        for row in rows
    ]


def _find_zone(intersection: IntersectionMap, *ids: str | None) -> list[Any] | None:
    keys = {route.zone_key for route in intersection.routes if route.id in ids}
    for zone in intersection.conflict_zones:
        if len(keys) == 2 and {zone.first, zone.second} == keys:
            return _round(zone.polygon)
    return None


def _describe_proof(proof: Proof) -> dict[str, Any]:
    fields = {"verified", "incidental", "missing", "interference", "implausible",
              "signal_violations", "figures"}  # fmt: skip
    verdict = {"verdict": proof.describe_verdict(), "caveat": proof.caveat}
    return {**proof.model_dump(mode="json", by_alias=True, include=fields), **verdict}


def _list_words(scene: SceneRecord, proof: Proof) -> list[dict[str, Any]]:
    """The account with its places counted from the beginning of the first text."""
    starts = [0, *accumulate(len(text) + len(NEXT_TEXT) for text in scene.meta.texts)]
    return [
        {**each.model_dump(mode="json"), "start": starts[each.turn] + each.start,
         "end": starts[each.turn] + each.end,
         "claim": speak_plainly(each.claim or "", scene),
         "evidence": speak_plainly(each.evidence, scene)}
        for each in proof.account
    ]  # fmt: skip


def _round(values: ArrayLike, digits: int = 2) -> list[Any]:
    rounded: list[Any] = np.round(np.asarray(values, dtype=float), digits).tolist()
    return rounded


def _hash_source(text: str) -> str:
    """The hash by which a content security policy allows one inline script or style."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


@lru_cache
def _read_part(name: str) -> str:
    return (files("scenewright.viz") / "player" / name).read_text(encoding="utf-8")
