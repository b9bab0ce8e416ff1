"""A scene as one still picture."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenewright.files import write_atomically
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.phrasing import call_agents
from scenewright.scene.record import EventRecord, SceneRecord
from scenewright.viz.appearance import (
    BACKGROUND_PEDESTRIAN,
    BACKGROUND_VEHICLE,
    LIGHTS,
    STANDING,
    DrawnMotion,
    choose_view,
    colour_verdict,
    describe_object,
    find_light_colours,
    find_main_time,
    is_night,
    list_motions,
    make_printable,
    outline_object,
)
from scenewright.viz.basemap import draw_basemap, draw_north, draw_road_names, draw_scale
from scenewright.viz.drawing import (
    INK,
    OCTAGON,
    SOFT_INK,
    STAR,
    Drawing,
    create_page,
    measure_block,
)
from scenewright.viz.label_placement import LabelLayout
from scenewright.viz.road_markings import find_light_positions

WIDTH = 7.0
MARGIN = 0.18
STOP_RED = "#B3202A"
EVENT_WORDS = {
    "collision": "collision",
    "near_miss": "near miss",
    "yielding": "yielding",
    "follow": "following",
    "normal": "normal",
}


def draw_scene(
    path: str | Path,
    *,
    scene: SceneRecord,
    proof: Proof | None,
    intersection: IntersectionMap,
    dpi: int = 200,
) -> None:
    """Draw a scene as one PNG: the map, what all agents did, and the event.

    Footprints are solid at the time of the first event, faded before it and outlined after it;
    dots on the trails are one second apart.

    Raises:
        InputError: the file cannot be written; nothing is left behind.
    """
    write_atomically(path, draw_page(scene, proof, intersection).render(dpi))


def draw_page(scene: SceneRecord, proof: Proof | None, intersection: IntersectionMap) -> Drawing:
    """The picture, not yet rendered."""
    title = textwrap.wrap(make_printable(scene.meta.user_prompt, limit=320), 84) or [
        "Untitled scene"
    ]
    moving = list_motions(scene)
    entries = _list_legend_entries(scene, moving)
    side = WIDTH - 2 * MARGIN
    beside = [] if proof is None else textwrap.wrap(make_printable(proof.caveat), 96)
    above = 0.52 + 0.2 * (len(title) + len(beside))
    page = create_page(WIDTH, above + side + 0.12 + 0.2 * len(entries))
    axes = page.add_map(choose_view(scene, moving, intersection), MARGIN, above, side, side)
    draw_basemap(axes, intersection, night=is_night(scene))
    _draw_agents(axes, scene, moving, intersection)
    draw_scale(axes)
    draw_north(axes)
    # The instruction, facts and the verdict; below the verdict what stands beside it.
    meta, room = scene.meta, page.scale * (WIDTH - 2 * MARGIN)
    size = 10.5 / max(1.0, measure_block(title, 10.5)[0] / room)
    page.write("\n".join(title), (MARGIN, 0.16), size, above=0.0)
    facts = [meta.scene_id, meta.intersection, meta.time_of_day]
    facts += [f"{meta.density} density"] if meta.density else []
    facts += [f"seed {meta.seed}"]
    below = 0.24 + 0.2 * len(title)
    words = make_printable("  ·  ".join(facts), limit=110)
    page.write(words, (MARGIN, below), 8, above=0.0, fill=SOFT_INK)
    if proof is not None:
        mark = "✓ " if proof.verified else ""
        page.write(mark + "\n".join([proof.verdict, *beside]), (WIDTH - MARGIN, below), 8.5,
                   align="end", above=0.0, bold=True, spacing=1.5,
                   fill=colour_verdict(proof))  # fmt: skip
    _draw_legend(page, entries, above + side + 0.12)
    return page


def _draw_agents(
    axes: Drawing, scene: SceneRecord, moving: list[DrawnMotion], intersection: IntersectionMap
) -> None:
    time = find_main_time(scene)
    layout = _reserve_label_space(axes, scene, moving)
    layout.avoid(
        np.array([p for spots in find_light_positions(intersection).values() for p in spots])
    )
    layout.avoid(draw_road_names(axes, intersection, avoid=np.vstack(layout.points)))
    draw_lights(axes, scene, intersection, time)
    draw_objects(axes, scene)
    _draw_recent_tracks(axes, [motion for motion in moving if not motion.is_foreground], time)
    for motion in moving:
        if motion.is_foreground:
            _draw_trail(axes, motion, time)
            # Footprints before (filled, faint) and after (outlines) the time of the picture.
            for index, offset in choose_ghost_samples(motion, time):
                fade = max(0.12, 0.42 - 0.05 * abs(offset)) if offset < 0 else 0.0
                axes.draw([motion.compute_outline(index)], closed=True, order=6.5,
                          fill=motion.colour, fill_opacity=fade, stroke=motion.colour,
                          stroke_opacity=0.5, stroke_width=0.8)  # fmt: skip
    for number, motion in enumerate(moving):
        _draw_footprint(axes, motion, time, order=10 + 2 * number / len(moving))
    _draw_labels(axes, layout, scene, moving)


def draw_objects(axes: Drawing, scene: SceneRecord) -> None:
    """Standing objects: hatched where they block the view."""
    for scene_object in scene.objects:
        # A white rim would leave nothing of a door.
        rim = STANDING if scene_object.kind == "door" else "white"
        outline = outline_object(scene_object)
        axes.draw([outline], closed=True, order=9.5, fill=STANDING)
        if scene_object.height == "high":
            hatch = _hatch_outline(outline, 6.0 / axes.scale)
            axes.draw(hatch, order=9.5, stroke="white", stroke_width=1.2)
        axes.draw([outline], closed=True, order=9.5, stroke=rim, stroke_width=0.9)


def _hatch_outline(corners: FloatArray, gap: float) -> list[FloatArray]:
    """Diagonals across a convex outline, so far apart from west to east [m]."""
    offsets = corners[:, 0] - corners[:, 1]
    lines = []
    for offset in np.arange(offsets.min() + gap / 2, offsets.max(), gap):
        share = offsets - offset
        crosses = np.flatnonzero(share * np.roll(share, -1) < 0)
        ends = np.roll(corners, -1, axis=0)[crosses] - corners[crosses]
        reach = share[crosses] / (share - np.roll(share, -1))[crosses]
        lines.append(corners[crosses] + reach[:, None] * ends)
    return lines


def _reserve_label_space(
    axes: Drawing, scene: SceneRecord, moving: list[DrawnMotion]
) -> LabelLayout:
    """Space that labels must not cover; the corners belong to the scale bar and the north arrow."""
    west, east, south, north = axes.view
    side, time = east - west, find_main_time(scene)
    layout = LabelLayout(axes)
    layout.boxes += [
        (west, south, west + 0.3 * side, south + 0.09 * side),
        (east - 0.1 * side, north - 0.15 * side, east, north),
    ]
    for motion in moving:
        index = motion.find_sample(time)
        if index is not None:
            layout.avoid(_fill_outline(motion.compute_outline(index)))
        if motion.is_foreground:
            layout.avoid(motion.xy[::3])
    for scene_object in scene.objects:
        layout.avoid(_fill_outline(outline_object(scene_object)))
    return layout


def _fill_outline(outline: FloatArray) -> FloatArray:
    """Points all over a footprint: its edges and shrunken copies of them."""
    following = np.roll(outline, -1, axis=0)
    outline = np.vstack([outline + f * (following - outline) for f in (0, 0.2, 0.4, 0.6, 0.8)])
    middle = outline.mean(axis=0)
    return np.vstack([middle + k * (outline - middle) for k in (1.0, 0.66, 0.33, 0.0)])


def draw_lights(
    axes: Drawing, scene: SceneRecord, intersection: IntersectionMap, time: float
) -> None:
    """A dot beside every stop line and at both ends of every crosswalk that has a light."""
    now = find_light_colours(scene, time)
    places = find_light_positions(intersection)
    for name, colour in now.items():
        spots = np.array(places.get(name, [])).reshape(-1, 2)
        size = 5.8 if len(spots) == 1 else 4.1
        axes.mark(spots, size, order=9, fill=LIGHTS[colour], stroke=INK, stroke_width=1.1)


def _draw_recent_tracks(axes: Drawing, moving: list[DrawnMotion], time: float) -> None:
    """Draw the last seconds of tracks, muted."""
    tracks: dict[str, list[FloatArray]] = {}
    for motion in moving:
        recent = motion.xy[(motion.times <= time) & (motion.times >= time - 4.0)]
        if any(_is_inside(axes, point) for point in recent[::5]):
            tracks.setdefault(motion.colour, []).append(recent)
    for colour, lines in tracks.items():
        draw_fading_lines(axes, lines, colour, np.linspace(0.07, 0.55, 12), width=1.6, order=5)


def _draw_trail(axes: Drawing, motion: DrawnMotion, time: float) -> None:
    before = motion.xy[motion.times <= time + 1e-6]
    strengths = np.linspace(0.11, 0.95, 24)
    draw_fading_lines(axes, [before], motion.colour, strengths, width=2.2, order=7)
    after = motion.xy[motion.times >= time - 1e-6]
    if len(after):
        axes.draw([after], order=6, stroke=motion.colour, stroke_width=1.2,
                  stroke_dasharray="3.6 2.4", stroke_opacity=0.75)  # fmt: skip
    seconds = motion.xy[find_full_seconds(motion)]
    axes.mark(seconds, 2.2, order=8, fill="white", stroke=motion.colour, stroke_width=0.8)


def draw_fading_lines(
    axes: Drawing, lines: Sequence[FloatArray], colour: str, strengths: FloatArray, *,
    width: float, order: float = 3,
) -> None:  # fmt: skip
    """Lines [N, 2] [m] in pieces of these opacities [S], from their starts to their ends."""
    for number, strength in enumerate(strengths):
        pieces = [
            xy[len(xy) * number // len(strengths) : len(xy) * (number + 1) // len(strengths) + 1]
            for xy in lines
        ]
        axes.draw([piece for piece in pieces if len(piece) > 1], order=order, stroke=colour,
                  stroke_width=width, stroke_opacity=round(float(strength), 3))  # fmt: skip


def choose_ghost_samples(motion: DrawnMotion, time: float) -> list[tuple[int, float]]:
    """Samples at full seconds whose footprints lie apart, and how much later than `time` [s]."""
    here = motion.find_sample(time)
    gap = max(1.3 * motion.agent.length, 2.4) if motion.agent.type != "pedestrian" else 2.4
    seconds = find_full_seconds(motion)
    later = [i for i in seconds if motion.times[i] > time]
    earlier = [i for i in reversed(seconds) if motion.times[i] < time]
    start = [] if here is None else [here]
    chosen = _keep_apart(motion.xy, start, earlier, gap) + _keep_apart(motion.xy, start, later, gap)
    return [(i, float(motion.times[i] - time)) for i in chosen]


def find_full_seconds(motion: DrawnMotion) -> list[int]:
    """Samples nearest to 0 s, 1 s, 2 s, ... of the scene."""
    whole = np.arange(np.ceil(motion.times[0]), np.floor(motion.times[-1]) + 0.5)
    return [int(np.argmin(np.abs(motion.times - t))) for t in whole]


def _keep_apart(xy: FloatArray, start: list[int], samples: list[int], gap: float) -> list[int]:
    kept = list(start)
    for i in samples:
        if not kept or np.linalg.norm(xy[i] - xy[kept[-1]]) >= gap:
            kept.append(i)
    return kept[len(start) :]


def _draw_footprint(axes: Drawing, motion: DrawnMotion, time: float, *, order: float) -> None:
    index = motion.find_sample(time)
    if index is None:
        return
    outline = motion.compute_outline(index)
    axes.draw([outline], closed=True, order=order, fill=motion.colour, stroke="white",
              stroke_width=0.9)  # fmt: skip
    if motion.agent.type != "pedestrian":
        pane = compute_windscreen(motion, index)
        axes.draw([pane], closed=True, order=order, fill="white", fill_opacity=0.75)
    elif motion.is_foreground:
        ring = motion.xy[index] + 3 * (outline - motion.xy[index])
        axes.draw([ring], closed=True, order=order, stroke=motion.colour, stroke_width=1.3)


def compute_windscreen(motion: DrawnMotion, index: int) -> FloatArray:
    """[4, 2] a light bar behind the nose that shows which way a vehicle faces [m]."""
    angle, length, width = motion.heading[index], motion.agent.length, motion.agent.width
    ahead = np.array([np.cos(angle), np.sin(angle)])
    left = np.array([-ahead[1], ahead[0]])
    back = length / 2 - min(0.36 * length, 1.9)
    corners = [(back, -0.36), (back + 0.7, -0.42), (back + 0.7, 0.42), (back, 0.36)]
    return np.array([motion.xy[index] + a * ahead + b * width * left for a, b in corners])


def _draw_labels(
    axes: Drawing, layout: LabelLayout, scene: SceneRecord, moving: list[DrawnMotion]
) -> None:
    """Write events first: they have the first choice of space."""
    for event in scene.events:
        if event.location is not None and event.time is not None:
            _draw_event(axes, layout, event)
    for motion in moving:
        if motion.is_foreground:
            _write_name(axes, layout, motion, find_main_time(scene))
            _mark_stops(axes, layout, motion)
    for motion in moving:
        if motion.is_foreground:
            # The time of every faded footprint.
            for index, _ in choose_ghost_samples(motion, find_main_time(scene)):
                at = motion.xy[index]
                if _is_inside(axes, at):
                    layout.write(f"{motion.times[index]:.0f} s", at, 6.5, motion.colour, order=20,
                                 distances=(motion.agent.width / 2 + 0.1,))  # fmt: skip


def _draw_event(axes: Drawing, layout: LabelLayout, event: EventRecord) -> None:
    spot = np.array(event.location, dtype=float)
    if event.type in ("collision", "near_miss"):
        axes.mark(spot, 12.2, corners=STAR, order=22, fill="#FFD23F", stroke=INK, stroke_width=1.2)
    else:
        axes.mark(spot, 8.9, order=22, fill="white", stroke=INK, stroke_width=1.2)
        axes.mark(spot, 5.0, order=22, fill=INK)
    words = f"{EVENT_WORDS[event.type]} · t = {event.time:.1f} s"
    side = axes.view[1] - axes.view[0]
    layout.write(
        words, spot, 9.5, INK, distances=(0.07 * side, 0.11 * side, 0.16 * side), leader=True,
        bold=True, box=("white", INK), order=23,
    )  # fmt: skip


def _write_name(axes: Drawing, layout: LabelLayout, motion: DrawnMotion, time: float) -> None:
    index = motion.find_sample(time)
    anchor = motion.xy[index if index is not None else 0]
    if _is_inside(axes, anchor):
        reach = max(motion.agent.length / 2, 0.6)
        layout.write(motion.called, anchor, 8.5, motion.colour, bold=True, order=24,
                     distances=(0.5 * reach + 0.9, reach + 0.9))  # fmt: skip


def _is_inside(axes: Drawing, point: FloatArray) -> bool:
    west, east, south, north = axes.view
    return bool(west < point[0] < east and south < point[1] < north)


def _mark_stops(axes: Drawing, layout: LabelLayout, motion: DrawnMotion) -> None:
    """A stop sign and a bar at the front of a stationary agent, with the time it is stationary."""
    for segment in motion.agent.segments:
        stand = (
            motion.find_standstill(segment.start, segment.end) if segment.status == "stop" else None
        )
        if stand is None or not _is_inside(axes, motion.xy[stand[0]]):
            continue
        index = stand[0]
        angle = motion.heading[index]
        ahead = np.array([np.cos(angle), np.sin(angle)])
        right = np.array([ahead[1], -ahead[0]])
        middle, reach = motion.compute_front(index) + 0.35 * ahead, 0.75 * motion.agent.width
        bar = np.array([middle - reach * right, middle + (reach + 0.4) * right])
        axes.draw([bar], order=13, stroke=STOP_RED, stroke_width=1.6)
        sign = bar[1]
        axes.mark(sign, 7.9, corners=OCTAGON, order=14, fill=STOP_RED, stroke="white",
                  stroke_width=0.9)  # fmt: skip
        begin, end = motion.times[stand[0]], motion.times[stand[1]]
        layout.avoid(sign[None])
        layout.write(f"stands {begin:.1f}–{end:.1f} s", sign, 7.5, STOP_RED, order=24,
                     distances=(0.9, 1.8))  # fmt: skip


def _list_legend_entries(
    scene: SceneRecord, moving: list[DrawnMotion]
) -> list[list[tuple[str, str, str]]]:
    """Rows of (symbol, colour, words)."""
    actions = _describe_events(scene)
    rows = []
    for m in sorted((m for m in moving if m.is_foreground), key=lambda m: m.agent.id):
        symbol = "pedestrian" if m.agent.type == "pedestrian" else "vehicle"
        rows.append([(symbol, m.colour, _describe_agent(m, actions))])
    keys = [("vehicle", BACKGROUND_VEHICLE, "background vehicle"),
            ("pedestrian", BACKGROUND_PEDESTRIAN, "background pedestrian"),
            ("dot", "#FFFFFF", "one second")]  # fmt: skip
    rows += [[("vehicle", STANDING, f"{o.id}: {describe_object(o)}")] for o in scene.objects]
    if scene.signals:
        keys.append(("light", LIGHTS["red"], f"signal at {find_main_time(scene):.1f} s"))
    return [*rows, keys]


def _describe_events(scene: SceneRecord) -> dict[int, str]:
    names = call_agents(scene)
    verbs = {"yielding": "yields to", "follow": "follows", "collision": "collides with",
             "near_miss": "has a near miss with"}  # fmt: skip
    actions: dict[int, str] = {}
    for event in scene.events:
        if event.from_ is not None and event.to is not None and event.type in verbs:
            action = f"{verbs[event.type]} {names.get(event.to, event.to)}"
            before = actions.get(event.from_)
            actions[event.from_] = action if before is None else f"{before}, {action}"
    return actions


def _describe_agent(motion: DrawnMotion, actions: dict[int, str]) -> str:
    agent = motion.agent
    way = f"{agent.entry} to {agent.exit}"
    if agent.movement in ("left", "right", "uturn"):
        way += f" ({agent.movement.replace('uturn', 'U-turn')})"
    if agent.crosswalk is not None:
        way += f", over the {agent.crosswalk} leg"
    action = f", {actions[agent.id]}" if agent.id in actions else ""
    return make_printable(f"{motion.called} ({agent.name}): {way}{action}", limit=110)


def _draw_legend(page: Drawing, rows: list[list[tuple[str, str, str]]], top: float) -> None:
    for number, row in enumerate(rows):
        x, y = MARGIN + 0.12, top + 0.2 * number + 0.04
        for symbol, colour, words in row:
            if symbol == "vehicle":
                bar = [(x - 0.08, y), (x + 0.08, y)]
                page.draw([bar], stroke=colour, stroke_width=5.8)
            else:
                size = {"pedestrian": 6.0, "dot": 3.0, "light": 5.5}[symbol]
                rim = "white" if symbol == "pedestrian" else INK
                page.mark([(x, y)], size, fill=colour, stroke=rim, stroke_width=0.9)
            page.write(words, (x + 0.2, y), 8)
            x += 0.45 + measure_block([words], 8)[0] / page.scale
