"""An intersection as a rerun recording: map, legs, movements, tracks, fitted priors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenewright.extras import require_extra
from scenewright.files import write_atomically
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.viz.appearance import make_printable, parse_colour
from scenewright.viz.recording import (
    APPLICATION,
    escape_markdown,
    join_entity_path,
    log_map,
    look_down,
    raise_points,
)

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

_TURNS = {"left": "#c05621", "straight": "#2b6cb0", "right": "#2f855a", "uturn": "#805ad5"}
_WALKS, _TRACKS, _INK = "#b7791f", (52, 58, 66), (40, 44, 52)
_HEIGHTS = {"movements": 0.03, "tracks": 0.06, "priors": 0.09, "names": 0.5}


def record_intersection(
    path: str | Path,
    *,
    intersection: IntersectionMap,
    tracks: Sequence[FloatArray] = (),
    priors: Mapping[str, Sequence[FloatArray]] | None = None,
    facts: Sequence[str] = (),
) -> None:
    """Write an intersection as one `.rrd` file.

    Args:
        tracks: [T, 2] recorded positions [m].
        priors: by route id, [P, 2] paths drawn from the fitted prior [m].
        facts: lines of plain text for the page beside the plan.

    Raises:
        InputError: the file cannot be written; nothing is left behind.
    """
    require_extra("recording", "a recording", "rerun")
    import rerun as rr

    stream = rr.RecordingStream(APPLICATION, recording_id=f"intersection-{intersection.name}")
    memory = stream.memory_recording()
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    log_map(stream, intersection)
    _log_legs(stream, intersection)
    _log_movements(stream, intersection)
    _log_curves(stream, "tracks", tracks, _TRACKS, "tracks", 0.04)
    for route in intersection.routes:
        colour = parse_colour(_TURNS.get(route.movement, _WALKS))
        drawn = (priors or {}).get(route.id, ())
        _log_curves(
            stream, join_entity_path("priors", route.type, route.id), drawn, colour, "priors", 0.05
        )
    lines = [f"### {escape_markdown(make_printable(intersection.title, limit=200))}", ""]
    lines += [f"- {escape_markdown(make_printable(fact, limit=400))}" for fact in facts]
    page = "\n".join(lines)
    stream.log("about", rr.TextDocument(page, media_type=rr.MediaType.MARKDOWN), static=True)
    stream.send_blueprint(_build_blueprint(intersection))
    write_atomically(path, memory.drain_as_bytes())


def _log_legs(stream: rr.RecordingStream, intersection_map: IntersectionMap) -> None:
    """Log every leg's name where it leaves the map."""
    import rerun as rr

    ways = [np.array([np.cos(leg.bearing), np.sin(leg.bearing)]) for leg in intersection_map.legs]
    places = np.array([0.92 * intersection_map.extent * way for way in ways])
    labels = [make_printable(f"{leg.name}: {leg.road}", limit=80) for leg in intersection_map.legs]
    points = rr.Points3D(raise_points(places, _HEIGHTS["names"]), labels=labels, colors=_INK,
                         radii=0.6, show_labels=True)  # fmt: skip
    stream.log("map/legs", points, static=True)


def _log_movements(stream: rr.RecordingStream, intersection_map: IntersectionMap) -> None:
    """Log the middle of every movement in the colour of its turn, with an arrow at its end."""
    import rerun as rr

    for movement in intersection_map.movements:
        line = np.array(movement.centreline)
        colour = parse_colour(_TURNS[movement.turn])
        name = join_entity_path("movements", movement.id)
        _log_curves(stream, name, [line], colour, "movements", 0.12)
        head = rr.Arrows3D(
            origins=raise_points(line[-2:-1], _HEIGHTS["movements"]),
            vectors=raise_points(line[-1:] - line[-2:-1], 0.0),
            colors=colour,
            radii=0.15,
        )
        stream.log(f"{name}/head", head, static=True)


def _log_curves(
    stream: rr.RecordingStream,
    path: str,
    curves: Sequence[FloatArray],
    colour: tuple[int, int, int],
    layer: str,
    radius: float,
) -> None:
    import rerun as rr

    strips = [
        raise_points(np.asarray(curve), _HEIGHTS[layer]) for curve in curves if len(curve) > 1
    ]
    if strips:
        stream.log(path, rr.LineStrips3D(strips, colors=colour, radii=radius), static=True)


def _build_blueprint(intersection_map: IntersectionMap) -> rrb.Blueprint:
    """The plan from above, north up, and the facts beside it."""
    import rerun.blueprint as rrb

    contents = ["+ /**", "- /about/**"]
    plan = look_down(
        (0.0, 0.0), 2.4 * intersection_map.extent, name="Intersection (north up)", contents=contents
    )
    aside = rrb.TextDocumentView(origin="/about", name="Facts")
    return rrb.Blueprint(
        rrb.Horizontal(plan, aside, column_shares=[5, 2]),
        rrb.TimePanel(state="hidden"),
        rrb.SelectionPanel(state="collapsed"),
    )
