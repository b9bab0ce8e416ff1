"""The whole run as one rerun recording: map, candidates, priors, motion, states, checks, messages.

Only this module and `intersection_recording` import rerun. A recording is a view;
scene.json is the data. The plan view is a 3D view seen from above, because rerun's 2D views have
y pointing down and would show a mirrored map.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.files import write_atomically
from scenewright.scene.base import RIDERS, FloatArray
from scenewright.scene.events import Event, Proof
from scenewright.scene.kinds import list_shipped
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import PolygonWithHoles
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.record import EventRecord, SceneRecord, SignalRecord
from scenewright.viz.appearance import (
    LIGHTS,
    STANDING,
    STATES,
    DrawnMotion,
    choose_view,
    describe_object,
    list_motions,
    make_printable,
    parse_colour,
)
from scenewright.viz.road_markings import (
    build_crosswalk_bars,
    find_light_positions,
    find_painted_bounds,
    split_into_dashes,
)

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

APPLICATION = "scenewright"
TIMELINE = "scene_time"
TRAIL = 5.0
"""How long [s] the trail behind an agent is."""
WALKER_HEIGHT = 1.7
VEHICLE_HEIGHTS = {kind.id: kind.figures["height"] for kind in list_shipped("subtype")}
PAPER, PAVING, ASPHALT = (246, 244, 239), (228, 222, 210), (205, 209, 214)
PAINT, MEDIAN = (255, 255, 255), (224, 178, 60)
_LAYERS = {"walkable": -0.30, "road": -0.24, "crosswalks": -0.18, "lanes": -0.12}
"""Heights [m] of the painted layers; the viewer needs them apart to order them."""


def record_scene(
    path: str | Path,
    *,
    scene: SceneRecord,
    proof: Proof | None,
    intersection: IntersectionMap,
    candidates: Mapping[str, Sequence[FloatArray]] | None,
    priors: Mapping[str, FloatArray] | None,
    messages: Sequence[tuple[str, str]],
) -> None:
    """Write a run as one `.rrd` file whose recording id is the scene id.

    Args:
        candidates: [P, 2] paths offered for each agent, by agent name [m].
        priors: [P, 2] selected path of each agent, by agent name [m].
        messages: (sender, text) in order of time.

    Raises:
        InputError: the file cannot be written; nothing is left behind.
    """
    require_extra("recording", "a recording", "rerun")
    import rerun as rr

    stream = rr.RecordingStream(APPLICATION, recording_id=scene.meta.scene_id)
    memory = stream.memory_recording()
    moving = list_motions(scene)
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    log_map(stream, intersection)
    _log_paths(stream, "candidates", candidates or {}, moving, width=0.03, strength=0.3)
    _log_paths(stream, "priors", {n: [p] for n, p in (priors or {}).items()}, moving, width=0.09,
               strength=0.65)  # fmt: skip
    for scene_object in scene.objects:
        _log_object(stream, scene_object)
    for motion in moving:
        _log_motion(stream, motion)
    _log_states(stream, scene)
    _log_signals(stream, scene, intersection)
    _log_events(stream, scene)
    _log_report(stream, scene, proof, messages)
    stream.send_blueprint(_build_blueprint(scene, moving, intersection))
    write_atomically(path, memory.drain_as_bytes())


def open_recording(path: str | Path) -> None:
    """Show a recording in the rerun viewer and wait until it is closed.

    Args:
        path: an `.rrd` file, or a folder with `scene.rrd`.

    Raises:
        InputError: there is no readable recording, no viewer, or the viewer fails.
    """
    recording = _find_recording(Path(path))
    # The `rerun` command of this environment, else the one on PATH.
    name = "rerun.exe" if os.name == "nt" else "rerun"
    beside = Path(sys.executable).with_name(name)
    found = str(beside) if beside.is_file() else shutil.which(name)
    if found is None:
        raise InputError("no `rerun` command found: pip install 'scenewright[recording]'")
    command = [found, "--bind", "127.0.0.1", str(recording)]
    try:
        done = subprocess.run(command, check=False, stderr=subprocess.PIPE, text=True)
    except OSError as error:
        raise InputError(f"the rerun viewer does not start: {error.strerror or error}") from error
    except KeyboardInterrupt:
        return
    if done.returncode:
        raise InputError(
            f"the rerun viewer stopped with code {done.returncode}; without a display, "
            f"`rerun --web-viewer --bind 127.0.0.1 {recording}` serves it to a browser"
        )


def _find_recording(path: Path) -> Path:
    recording = path / "scene.rrd" if path.is_dir() else path
    try:
        with recording.open("rb") as file:
            head = file.read(4)
    except OSError as error:
        raise InputError(f"cannot read {recording}: {error.strerror or error}") from error
    if head not in (b"RRF2", b"RRIO"):
        raise InputError(f"{recording} is not a rerun recording (.rrd)")
    return recording


def log_map(stream: rr.RecordingStream, intersection: IntersectionMap) -> None:
    """Log the ground, the markings and the movements of an intersection."""
    _log_area(stream, "map/walkable", intersection.walkable, PAVING)
    _log_area(stream, "map/road", intersection.road, ASPHALT)
    bars = [bar for walk in intersection.crosswalks for bar in build_crosswalk_bars(walk)]
    if bars:
        corners = np.vstack([quad[[0, 1, 2, 0, 2, 3]] for quad in bars])
        _log_mesh(stream, "map/crosswalks", corners, PAINT, _LAYERS["crosswalks"])
    bounds = find_painted_bounds(intersection)
    broken = [dash for line in bounds["divider"] for dash in split_into_dashes(line)]
    _log_lines(stream, "map/lanes/median", bounds["median"], MEDIAN, 0.09)
    _log_lines(stream, "map/lanes/divider", broken, PAINT, 0.07)
    _log_lines(stream, "map/lanes/edge", bounds["edge"], PAINT, 0.06)
    middles = [np.array(movement.centreline) for movement in intersection.movements]
    _log_lines(stream, "map/movements", middles, (180, 186, 194), 0.03)
    lines = [np.array(line.line) for line in intersection.stop_lines]
    _log_lines(stream, "map/stop_lines", lines, PAINT, 0.22)


def _log_lines(
    stream: rr.RecordingStream,
    path: str,
    lines: Sequence[FloatArray],
    colour: tuple[int, int, int],
    radius: float,
) -> None:
    import rerun as rr

    strips = [raise_points(line, _LAYERS["lanes"]) for line in lines]
    stream.log(path, rr.LineStrips3D(strips, colors=colour, radii=radius), static=True)


def raise_points(xy: FloatArray, height: float) -> FloatArray:
    """[N, 3] points of a polyline at a height [m]."""
    return np.column_stack([xy, np.full(len(xy), height)])


def _log_area(
    stream: rr.RecordingStream,
    path: str,
    areas: tuple[PolygonWithHoles, ...],
    colour: tuple[int, int, int],
) -> None:
    import shapely

    geos: Any = shapely
    shapes = [geos.Polygon(area.exterior, area.holes) for area in areas]
    parts = geos.get_parts([geos.constrained_delaunay_triangles(shape) for shape in shapes])
    corners = [geos.get_coordinates(part)[:3] for part in parts]
    if corners:
        height = _LAYERS[path.removeprefix("map/")]
        _log_mesh(stream, path, np.vstack(corners), colour, height)


def _log_mesh(
    stream: rr.RecordingStream,
    path: str,
    corners: FloatArray,
    colour: tuple[int, int, int],
    height: float,
) -> None:
    """Triangles given by [3 N, 2] corners [m]."""
    import rerun as rr

    mesh = rr.Mesh3D(
        vertex_positions=raise_points(corners, height),
        triangle_indices=np.arange(len(corners)).reshape(-1, 3),
        vertex_colors=np.tile(np.array(colour, dtype=np.uint8), (len(corners), 1)),
    )
    stream.log(path, mesh, static=True)


def _log_paths(
    stream: rr.RecordingStream,
    root: str,
    paths: Mapping[str, Sequence[FloatArray]],
    moving: list[DrawnMotion],
    *,
    width: float,
    strength: float,
) -> None:
    """Curves by agent name; lines have no transparency, so weak ones fade into the asphalt."""
    import rerun as rr

    colours = {motion.agent.name: motion.colour for motion in moving}
    for name, curves in paths.items():
        strips = [raise_points(np.asarray(curve), 0.02) for curve in curves if len(curve) > 1]
        shade = np.array(parse_colour(colours.get(name, "#808080")))
        colour = (strength * shade + (1 - strength) * np.array(ASPHALT)).astype(np.uint8)
        stream.log(join_entity_path(root, name),
                   rr.LineStrips3D(strips, colors=colour, radii=width), static=True)  # fmt: skip


def join_entity_path(*parts: str) -> str:
    """An entity path; rerun's special characters in names are escaped."""
    import rerun as rr

    return "/".join(rr.escape_entity_path_part(part) for part in parts)


def _log_motion(stream: rr.RecordingStream, motion: DrawnMotion) -> None:
    """A moving frame with the body in it, a trail, and the speed."""
    import rerun as rr

    name, half = motion.agent.name, motion.heading / 2
    turns = np.column_stack([np.zeros((len(half), 2)), np.sin(half), np.cos(half)])
    poses = rr.Transform3D.columns(translation=raise_points(motion.xy, 0.0), quaternion=turns)
    _send(stream, join_entity_path("agents", name), motion.times, poses)
    _log_body(stream, motion)
    _log_trail(stream, motion)
    stream.log(join_entity_path("speed", name), rr.SeriesLines(
        colors=parse_colour(motion.colour), names=name, widths=2.5 if motion.is_foreground else 1.0,
    ), static=True)  # fmt: skip
    speeds = rr.Scalars.columns(scalars=motion.speed)
    _send(stream, join_entity_path("speed", name), motion.times, speeds)
    if not motion.stays:
        gone = motion.times[-1:] + 0.1
        for root in ("agents", "trails"):
            _send(stream, join_entity_path(root, name), gone, rr.Clear.columns(is_recursive=[True]))


def _send(
    stream: rr.RecordingStream, path: str, times: FloatArray | Sequence[float], columns: Any
) -> None:
    import rerun as rr

    stream.send_columns(path, indexes=[rr.TimeColumn(TIMELINE, duration=times)], columns=columns)


def _log_object(stream: rr.RecordingStream, record: ObjectRecord) -> None:
    """Log a standing object as a box: static, or from when it is there."""
    import rerun as rr

    usual = 1.1 if record.height == "low" else 2.0
    height = VEHICLE_HEIGHTS.get(record.subtype or "", 1.5 if record.subtype else usual)
    box = rr.Boxes3D(
        half_sizes=[(record.length / 2, record.width / 2, height / 2)],
        centers=[(record.x, record.y, height / 2)],
        rotation_axis_angles=[rr.RotationAxisAngle((0, 0, 1), angle=record.heading)],
        colors=[parse_colour(STANDING)], fill_mode=rr.components.FillMode.Solid,
        labels=[f"{record.id}: {describe_object(record)}"],
    )  # fmt: skip
    if record.since is not None:
        stream.set_time(TIMELINE, duration=record.since)
    stream.log(join_entity_path("objects", record.id), box, static=record.since is None)
    stream.reset_time()


def _log_body(stream: rr.RecordingStream, motion: DrawnMotion) -> None:
    """Log the body when the agent appears; static, it would show before that."""
    import rerun as rr

    agent, begin = motion.agent, motion.times[:1]
    path, colour = join_entity_path("agents", agent.name, "body"), [parse_colour(motion.colour)]
    label: dict[str, Any] = {"labels": [motion.called], "show_labels": [motion.is_foreground]}
    if agent.type == "pedestrian":
        columns = rr.Cylinders3D.columns(
            lengths=[WALKER_HEIGHT], radii=[agent.width / 2], centers=[(0, 0, WALKER_HEIGHT / 2)],
            colors=colour, fill_mode=[rr.components.FillMode.Solid], **label,
        )  # fmt: skip
        _send(stream, path, begin, columns)
        return
    height = VEHICLE_HEIGHTS.get(agent.subtype or "car", 1.5)
    height = WALKER_HEIGHT if agent.type in RIDERS else height
    columns = rr.Boxes3D.columns(
        half_sizes=[(agent.length / 2, agent.width / 2, height / 2)],
        centers=[(0, 0, height / 2)], colors=colour,
        fill_mode=[rr.components.FillMode.Solid], **label,
    )  # fmt: skip
    _send(stream, path, begin, columns)
    arrow = rr.Arrows3D.columns(
        vectors=[(agent.length * 0.36, 0, 0)], origins=[(0.08 * agent.length, 0, height + 0.05)],
        colors=[(255, 255, 255)], radii=[0.12],
    )  # fmt: skip
    _send(stream, join_entity_path("agents", agent.name, "heading"), begin, arrow)


def _log_trail(stream: rr.RecordingStream, motion: DrawnMotion) -> None:
    """Log one short piece per sample; the view shows those of the last seconds."""
    import rerun as rr

    if len(motion.xy) < 2:
        return
    points = raise_points(motion.xy, 0.05)
    pieces = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
    colours = np.tile(np.array(parse_colour(motion.colour), dtype=np.uint8), (len(pieces), 1))
    lines = rr.LineStrips3D.columns(strips=pieces, colors=colours, radii=np.full(len(pieces), 0.12))
    _send(stream, join_entity_path("trails", motion.agent.name), motion.times[1:], lines)


def _log_states(stream: rr.RecordingStream, scene: SceneRecord) -> None:
    """Every agent's behavioral segments as a lane of states."""
    import rerun as rr

    for agent in scene.agents:
        if agent.segments:
            path = join_entity_path("states", agent.name)
            _log_state_colours(stream, path, dict(STATES))
            times = [segment.start for segment in agent.segments] + [agent.segments[-1].end]
            states = [segment.status for segment in agent.segments] + [""]
            _send(stream, path, times, rr.StateChange.columns(state=states))


def _log_state_colours(stream: rr.RecordingStream, path: str, colours: Mapping[Any, str]) -> None:
    import rerun as rr

    configuration = rr.StateConfiguration(
        values=list(colours), colors=[(*parse_colour(colour), 255) for colour in colours.values()]
    )
    stream.log(path, configuration, static=True)


def _log_signals(
    stream: rr.RecordingStream, scene: SceneRecord, intersection: IntersectionMap
) -> None:
    """Lights as coloured points at the kerb, and as lanes of states."""
    import rerun as rr

    places = find_light_positions(intersection)
    lights: dict[str, list[SignalRecord]] = {}
    for row in sorted(scene.signals, key=lambda row: row.start):
        lights.setdefault(row.stop_line or row.crosswalk or "light", []).append(row)
    for name, rows in lights.items():
        times = [row.start for row in rows]
        lane = join_entity_path("signal_states", name)
        _log_state_colours(stream, lane, dict(LIGHTS))
        _send(stream, lane, times, rr.StateChange.columns(state=[row.colour for row in rows]))
        spots = [(x, y, 0.3) for x, y in places.get(name, [])]
        if spots:
            size = 0.55 if len(spots) == 1 else 0.38
            dots = rr.Points3D.columns(
                positions=np.tile(spots, (len(rows), 1)),
                colors=[parse_colour(LIGHTS[row.colour]) for row in rows for _ in spots],
                radii=np.full(len(rows) * len(spots), size),
            )
            _send(stream, join_entity_path("signals", name), times,
                  dots.partition(lengths=[len(spots)] * len(rows)))  # fmt: skip


def _log_events(stream: rr.RecordingStream, scene: SceneRecord) -> None:
    import rerun as rr

    names = {agent.id: agent.name for agent in scene.agents}
    for number, event in enumerate(scene.events, start=1):
        if event.time is None or event.location is None:
            continue
        words = f"{event.type.replace('_', ' ')}  {event.time:.1f} s"
        (x, y), path = event.location, join_entity_path("events", str(number))
        _send(stream, path, [event.time], rr.Points3D.columns(
            positions=[(x, y, 4.0)], radii=[0.45], colors=[(255, 210, 63)],
        ))  # fmt: skip
        # A line has its label at its middle: beside the place, not on the agents there.
        _send(stream, path + "/label", [event.time], rr.LineStrips3D.columns(
            strips=[[(x, y, 4.0), (x + 9.0, y - 7.0, 4.0)]], radii=[0.05],
            colors=[(255, 210, 63)], labels=[words], show_labels=[True],
        ))  # fmt: skip
        _send(stream, "log/events", [event.time],
              rr.TextLog.columns(text=[_describe_event(event, names)], level=["INFO"]))  # fmt: skip


def _describe_event(event: EventRecord | Event, names: Mapping[int, str]) -> str:
    first = names.get(event.from_ or 0, "no agent")
    second = names.get(event.to or 0, "no agent")
    return f"{event.type.replace('_', ' ')}: {first} → {second}"


def _log_report(
    stream: rr.RecordingStream,
    scene: SceneRecord,
    proof: Proof | None,
    messages: Sequence[tuple[str, str]],
) -> None:
    """Log the request and its proof as a page, the messages of the stages as a log."""
    import rerun as rr

    page = rr.TextDocument(_write_report(scene, proof), media_type=rr.MediaType.MARKDOWN)
    stream.log("report", page, static=True)
    if messages:
        entries = [
            f"{make_printable(sender, limit=60)}: {make_printable(text, limit=4000)}"
            for sender, text in messages
        ]
        _send(stream, "log/run", [0.0] * len(entries),
              rr.TextLog.columns(text=entries, level=["INFO"] * len(entries)))  # fmt: skip


def _write_report(scene: SceneRecord, proof: Proof | None) -> str:
    meta = scene.meta
    facts = [meta.scene_id, meta.intersection, meta.time_of_day, f"seed {meta.seed}"]
    lines = ["### Instruction", escape_markdown(make_printable(meta.user_prompt, limit=2000)), "",
             " · ".join(escape_markdown(fact) for fact in facts)]  # fmt: skip
    if proof is None:
        return "\n".join([*lines, "", "### Proof", "The scene was not checked."])
    verdict = escape_markdown(make_printable(proof.describe_verdict(), limit=400))
    lines += ["", "### Proof", f"**{verdict[0].upper()}{verdict[1:]}.**", ""]
    lines += _format_events(proof.events, {agent.id: agent.name for agent in scene.agents})
    for title in ("missing", "interference", "implausible", "signal_violations"):
        name, findings = title.replace("_", " "), getattr(proof, title)
        details = [
            escape_markdown(make_printable(finding.detail, limit=400)) for finding in findings
        ]
        lines += [f"- **{name}**: {each}" for each in details] or [f"- no {name}"]
    lines += ["", "### Words", "| words | state | claim | evidence |", "|---|---|---|---|"]
    for each in proof.account:
        cells = (each.words, each.state.replace("_", " "), each.claim or "", each.evidence)
        lines.append(f"| {' | '.join(escape_markdown(make_printable(c)) for c in cells)} |")
    return "\n".join(lines)


def escape_markdown(text: str) -> str:
    """Text in which nothing is markdown."""
    return "".join("\\" + c if c in "\\`*_{}[]<>()#+-.!|~$&" else c for c in text)


def _format_events(events: tuple[Event, ...], names: Mapping[int, str]) -> list[str]:
    if not events:
        return ["No events.", ""]
    rows = ["| event | time | evidence |", "|---|---|---|"]
    for event in events:
        evidence = ", ".join(
            (f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {make_printable(str(v), limit=80)}")
            + (f" at {event.when[k].time:.2f} s" if k in event.when else "")
            for k, v in event.evidence.items()
        )
        action = _describe_event(event, names)
        rows.append(f"| {action} | {event.time:.2f} s | {escape_markdown(evidence)} |")
    return [*rows, ""]


def _build_blueprint(
    scene: SceneRecord, moving: list[DrawnMotion], intersection: IntersectionMap
) -> rrb.Blueprint:
    """Plan view on the left; proof, segments, speeds and messages on the right."""
    import rerun.blueprint as rrb

    main = [f"+ /{join_entity_path('speed', m.agent.name)}" for m in moving if m.is_foreground]
    aside = rrb.Vertical(
        rrb.TextDocumentView(origin="/report", name="Request and proof"),
        rrb.Tabs(
            rrb.StateTimelineView(origin="/states", name="Segments"),
            rrb.StateTimelineView(origin="/signal_states", name="Signals"),
            active_tab=0,
        ),
        rrb.Tabs(
            rrb.TimeSeriesView(origin="/speed", contents=main, name="Speed [m/s]"),
            rrb.TimeSeriesView(
                origin="/speed", name="All speeds [m/s]", plot_legend=rrb.PlotLegend(visible=False)
            ),
            active_tab=0,
        ),
        rrb.TextLogView(origin="/log", name="Messages"),
        row_shares=[3, 2, 2.4, 2],
    )
    return rrb.Blueprint(
        rrb.Horizontal(_build_plan_view(scene, moving, intersection), aside, column_shares=[5, 3]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing",
                      loop_mode="all"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )  # fmt: skip


def _build_plan_view(
    scene: SceneRecord, moving: list[DrawnMotion], intersection: IntersectionMap
) -> rrb.Spatial3DView:
    """Seen from above, north up, east right; candidates of the background are left out."""
    import rerun.blueprint as rrb

    recent = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    west, east, south, north = choose_view(scene, moving, intersection)
    middle = ((west + east) / 2, (south + north) / 2)
    hidden = [
        f"- /{join_entity_path('candidates', m.agent.name)}" for m in moving if not m.is_foreground
    ]
    return look_down(
        middle, 1.2 * (east - west), name="Scene (north up)",
        contents=["+ /**", "- /report/**", "- /log/**", "- /speed/**", *hidden],
        overrides={join_entity_path("trails", motion.agent.name): recent for motion in moving},
    )  # fmt: skip


def look_down(place: tuple[float, float], height: float, **fields: Any) -> rrb.Spatial3DView:
    """A view of everything from so high above a place [m], north up."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin="/",
        background=rrb.Background(kind=rrb.BackgroundKind.SolidColor, color=PAPER),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=(*place, height), look_target=(*place, 0.0),
            eye_up=(0.0, 1.0, 0.0),
        ),
        **fields,
    )  # fmt: skip
