"""A scene as one still picture."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenewright.files import write_atomically
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
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
    list_motions,
    make_printable,
    outline_object,
    parse_colour,
)
from scenewright.viz.basemap import draw_basemap, draw_north, draw_road_names, draw_scale
from scenewright.viz.figure import (
    INK,
    SOFT_INK,
    add_map_axes,
    create_figure,
    draw_curve,
    draw_points,
    encode_png,
    make_drawable,
    use_plain_style,
)
from scenewright.viz.label_placement import LabelLayout
from scenewright.viz.road_markings import find_light_positions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
    with use_plain_style():
        write_atomically(path, encode_png(draw_figure(scene, proof, intersection, dpi)))


def draw_figure(
    scene: SceneRecord, proof: Proof | None, intersection: IntersectionMap, dpi: int
) -> Figure:
    """The picture, not yet written."""
    title = textwrap.wrap(make_drawable(scene.meta.user_prompt, limit=320), 84) or [
        "Untitled scene"
    ]
    moving = list_motions(scene)
    entries = _list_legend_entries(scene, moving)
    side = WIDTH - 2 * MARGIN
    beside = [] if proof is None else textwrap.wrap(make_drawable(proof.caveat), 96)
    above = 0.52 + 0.2 * (len(title) + len(beside))
    below = 0.12 + 0.2 * len(entries)
    figure = create_figure(WIDTH, above + side + below, dpi=dpi)
    height = above + side + below
    axes = add_map_axes(figure, (MARGIN / WIDTH, below / height, side / WIDTH, side / height))
    draw_basemap(axes, intersection, choose_view(scene, moving, intersection))
    _draw_agents(axes, scene, moving, intersection)
    draw_scale(axes)
    draw_north(axes)
    _draw_title(figure, title, beside, scene, proof)
    _draw_legend(figure, entries, height)
    return figure


def _draw_agents(
    axes: Axes, scene: SceneRecord, moving: list[DrawnMotion], intersection: IntersectionMap
) -> None:
    time = find_main_time(scene)
    layout = _reserve_label_space(axes, scene, moving)
    layout.avoid(
        np.array([p for spots in find_light_positions(intersection).values() for p in spots])
    )
    draw_road_names(axes, intersection, avoid=np.vstack(layout.points))
    draw_lights(axes, scene, intersection, time)
    draw_objects(axes, scene)
    for motion in moving:
        if motion.is_foreground:
            _draw_trail(axes, motion, time)
            _draw_ghosts(axes, motion, time)
        else:
            _draw_recent_track(axes, motion, time)
    for number, motion in enumerate(moving):
        _draw_footprint(axes, motion, time, order=10 + 2 * number / len(moving))
    _draw_labels(axes, layout, scene, moving)


def draw_objects(axes: Axes, scene: SceneRecord) -> None:
    """Standing objects: hatched where they block the view."""
    from matplotlib.patches import Polygon

    for each in scene.objects:
        axes.add_patch(
            Polygon(
                outline_object(each), closed=True, facecolor=STANDING, lw=0.9,
                # A white rim would leave nothing of a door.
                edgecolor=STANDING if each.kind == "door" else "white",
                hatch="////" if each.height == "high" else None, zorder=9.5,
            )
        )  # fmt: skip


def _reserve_label_space(axes: Axes, scene: SceneRecord, moving: list[DrawnMotion]) -> LabelLayout:
    """Space that labels must not cover; the corners belong to the scale bar and the north arrow."""
    west, east = axes.get_xlim()
    south, north = axes.get_ylim()
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
    for each in scene.objects:
        layout.avoid(_fill_outline(outline_object(each)))
    return layout


def _fill_outline(outline: FloatArray) -> FloatArray:
    """Points all over a footprint: its edges and shrunken copies of them."""
    following = np.roll(outline, -1, axis=0)
    outline = np.vstack([outline + f * (following - outline) for f in (0, 0.2, 0.4, 0.6, 0.8)])
    middle = outline.mean(axis=0)
    return np.vstack([middle + k * (outline - middle) for k in (1.0, 0.66, 0.33, 0.0)])


def draw_lights(axes: Axes, scene: SceneRecord, intersection: IntersectionMap, time: float) -> None:
    """A dot beside every stop line and at both ends of every crosswalk that has a light."""
    now = find_light_colours(scene, time)
    places = find_light_positions(intersection)
    for name, colour in now.items():
        spots = np.array(places.get(name, [])).reshape(-1, 2)
        size = 34 if len(spots) == 1 else 17
        draw_points(axes, spots, s=size, c=LIGHTS[colour], edgecolors=INK, linewidths=1.1, zorder=9)


def _draw_recent_track(axes: Axes, motion: DrawnMotion, time: float) -> None:
    """Draw the last seconds of the track, muted."""
    recent = (motion.times <= time) & (motion.times >= time - 4.0)
    _draw_fading_line(axes, motion.xy[recent], motion.colour, width=1.6, strongest=0.55, order=5)


def _draw_trail(axes: Axes, motion: DrawnMotion, time: float) -> None:
    before = motion.times <= time + 1e-6
    _draw_fading_line(axes, motion.xy[before], motion.colour, width=2.2, strongest=0.95, order=7)
    after = motion.xy[motion.times >= time - 1e-6]
    draw_curve(axes, after, color=motion.colour, lw=1.2, ls=(0, (3, 2)), alpha=0.75, zorder=6)
    seconds = find_full_seconds(motion)
    draw_points(
        axes, motion.xy[seconds], s=5, c="white", edgecolors=motion.colour, linewidths=0.8, zorder=8
    )


def _draw_fading_line(
    axes: Axes, xy: FloatArray, colour: str, *, width: float, strongest: float, order: int
) -> None:
    from matplotlib.collections import LineCollection

    if len(xy) < 2:
        return
    pieces = np.array_split(np.arange(len(xy)), max(1, min(24, len(xy) // 2)))
    lines = [xy[p[0] : p[-1] + 2] for p in pieces]
    shades = np.zeros((len(lines), 4))
    shades[:, :3] = np.array(parse_colour(colour)) / 255
    shades[:, 3] = np.linspace(0.12, 1.0, len(lines)) * strongest
    axes.add_collection(
        LineCollection(lines, colors=shades, linewidths=width, capstyle="butt", zorder=order),
        autolim=False,
    )


def _draw_ghosts(axes: Axes, motion: DrawnMotion, time: float) -> None:
    """Footprints before (filled, faint) and after (outlines) the time of the picture."""
    from matplotlib.patches import Polygon

    for index, offset in choose_ghost_samples(motion, time):
        fade = max(0.12, 0.42 - 0.05 * abs(offset))
        fill = (*np.array(parse_colour(motion.colour)) / 255, fade if offset < 0 else 0.0)
        edge = (*np.array(parse_colour(motion.colour)) / 255, 0.5)
        axes.add_patch(
            Polygon(
                motion.compute_outline(index),
                closed=True,
                facecolor=fill,
                edgecolor=edge,
                lw=0.8,
                zorder=6.5,
            )
        )


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


def _draw_footprint(axes: Axes, motion: DrawnMotion, time: float, *, order: float) -> None:
    from matplotlib.patches import Polygon

    index = motion.find_sample(time)
    if index is None:
        return
    axes.add_patch(
        Polygon(
            motion.compute_outline(index),
            closed=True,
            facecolor=motion.colour,
            edgecolor="white",
            lw=0.9,
            joinstyle="round",
            zorder=order,
        )
    )
    if motion.is_foreground and motion.agent.type == "pedestrian":
        ring = motion.xy[index] + 3 * (motion.compute_outline(index) - motion.xy[index])
        axes.add_patch(
            Polygon(ring, closed=True, fill=False, edgecolor=motion.colour, lw=1.3, zorder=order)
        )
    if motion.agent.type != "pedestrian":
        axes.add_patch(
            Polygon(
                compute_windscreen(motion, index),
                closed=True,
                facecolor="white",
                alpha=0.75,
                lw=0,
                zorder=order + 0.01,
            )
        )


def compute_windscreen(motion: DrawnMotion, index: int) -> FloatArray:
    """[4, 2] a light bar behind the nose that shows which way a vehicle faces [m]."""
    angle, length, width = motion.heading[index], motion.agent.length, motion.agent.width
    ahead = np.array([np.cos(angle), np.sin(angle)])
    left = np.array([-ahead[1], ahead[0]])
    back = length / 2 - min(0.36 * length, 1.9)
    corners = [(back, -0.36), (back + 0.7, -0.42), (back + 0.7, 0.42), (back, 0.36)]
    return np.array([motion.xy[index] + a * ahead + b * width * left for a, b in corners])


def _draw_labels(
    axes: Axes, layout: LabelLayout, scene: SceneRecord, moving: list[DrawnMotion]
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
            _mark_times(axes, layout, motion, find_main_time(scene))


def _draw_event(axes: Axes, layout: LabelLayout, event: EventRecord) -> None:
    spot = np.array(event.location, dtype=float)
    burst = event.type in ("collision", "near_miss")
    draw_points(axes, spot, s=150 if burst else 80, marker="*" if burst else "o",
                c="#FFD23F" if burst else "white", edgecolors=INK, linewidths=1.2,
                zorder=22)  # fmt: skip
    if not burst:
        draw_points(axes, spot, s=16, c=INK, zorder=22.1)
    words = f"{EVENT_WORDS[event.type]} · t = {event.time:.1f} s"
    side = axes.get_xlim()[1] - axes.get_xlim()[0]
    layout.write(
        words, spot, distances=(0.07 * side, 0.11 * side, 0.16 * side), leader=True, halo=False,
        fontsize=9.5, fontweight="bold", color=INK, zorder=23,
        bbox={"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": INK, "lw": 0.9},
    )  # fmt: skip


def _write_name(axes: Axes, layout: LabelLayout, motion: DrawnMotion, time: float) -> None:
    index = motion.find_sample(time)
    anchor = motion.xy[index if index is not None else 0]
    if _is_inside(axes, anchor):
        reach = max(motion.agent.length / 2, 0.6)
        layout.write(motion.agent.name, anchor, distances=(0.5 * reach + 0.9, reach + 0.9),
                     fontsize=8.5, fontweight="bold", color=motion.colour, zorder=24)  # fmt: skip


def _is_inside(axes: Axes, point: FloatArray) -> bool:
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    return bool(west < point[0] < east and south < point[1] < north)


def _mark_stops(axes: Axes, layout: LabelLayout, motion: DrawnMotion) -> None:
    """A stop sign and a bar at the front of a stationary agent, with the time it is stationary."""
    for segment in motion.agent.segments:
        stand = (
            motion.find_standstill(segment.start, segment.end) if segment.status == "stop" else None
        )
        if stand is None or not _is_inside(axes, motion.xy[stand[0]]):
            continue
        sign = _draw_stop_sign(axes, motion, stand[0])
        begin, end = motion.times[stand[0]], motion.times[stand[1]]
        layout.avoid(sign[None])
        layout.write(f"stands {begin:.1f}–{end:.1f} s", sign, distances=(0.9, 1.8), fontsize=7.5,
                     color=STOP_RED, zorder=24)  # fmt: skip


def _draw_stop_sign(axes: Axes, motion: DrawnMotion, index: int) -> FloatArray:
    angle = motion.heading[index]
    ahead = np.array([np.cos(angle), np.sin(angle)])
    right = np.array([ahead[1], -ahead[0]])
    middle, reach = motion.compute_front(index) + 0.35 * ahead, 0.75 * motion.agent.width
    bar = np.array([middle - reach * right, middle + (reach + 0.4) * right])
    draw_curve(axes, bar, color=STOP_RED, lw=1.6, zorder=13, solid_capstyle="butt")
    draw_points(axes, bar[1], s=62, marker=(8, 0, 22.5), c=STOP_RED, edgecolors="white",
                linewidths=0.9, zorder=14)  # fmt: skip
    return np.asarray(bar[1])


def _mark_times(axes: Axes, layout: LabelLayout, motion: DrawnMotion, time: float) -> None:
    """Write the time of every faded footprint."""
    for index, _ in choose_ghost_samples(motion, time):
        at = motion.xy[index]
        if _is_inside(axes, at):
            layout.write(f"{motion.times[index]:.0f} s", at,
                         distances=(motion.agent.width / 2 + 0.1,), fontsize=6.5,
                         color=motion.colour, zorder=20)  # fmt: skip


def _draw_title(
    figure: Figure, lines: list[str], beside: list[str], scene: SceneRecord, proof: Proof | None
) -> None:
    """The instruction, facts and the verdict; below the verdict what stands beside it."""
    meta, height = scene.meta, figure.get_figheight()
    left = MARGIN / WIDTH
    text = figure.text(left, 1 - 0.14 / height, "\n".join(lines), fontsize=10.5, color=INK,
                       va="top", ha="left", linespacing=1.3)  # fmt: skip
    wide = text.get_window_extent().width / (figure.dpi * (WIDTH - 2 * MARGIN))
    text.set_fontsize(10.5 / max(1.0, wide))
    facts = [meta.scene_id, meta.intersection, meta.time_of_day]
    facts += [f"{meta.density} density"] if meta.density else []
    facts += [f"seed {meta.seed}"]
    below = 1 - (0.24 + 0.2 * len(lines)) / height
    figure.text(left, below, make_drawable("  ·  ".join(facts), limit=110), fontsize=8,
                color=SOFT_INK, va="top", ha="left")  # fmt: skip
    if proof is not None:
        mark = "✓ " if proof.verified else ""
        figure.text(1 - left, below, mark + "\n".join([proof.verdict, *beside]), fontsize=8.5,
                    color=colour_verdict(proof), fontweight="bold", va="top", ha="right",
                    linespacing=1.5)  # fmt: skip


def _list_legend_entries(
    scene: SceneRecord, moving: list[DrawnMotion]
) -> list[list[tuple[str, str, str]]]:
    """Rows of (symbol, colour, words)."""
    actions = _describe_events(scene)
    rows = [
        [
            (
                "pedestrian" if m.agent.type == "pedestrian" else "vehicle",
                m.colour,
                _describe_agent(m, actions),
            )
        ]
        for m in sorted((m for m in moving if m.is_foreground), key=lambda m: m.agent.id)
    ]
    keys = [("vehicle", BACKGROUND_VEHICLE, "background vehicle"),
            ("pedestrian", BACKGROUND_PEDESTRIAN, "background pedestrian"),
            ("dot", "#FFFFFF", "one second")]  # fmt: skip
    rows += [[("vehicle", STANDING, f"{o.id}: {describe_object(o)}")] for o in scene.objects]
    if scene.signals:
        keys.append(("light", LIGHTS["red"], f"signal at {find_main_time(scene):.1f} s"))
    return [*rows, keys]


def _describe_events(scene: SceneRecord) -> dict[int, str]:
    names = {agent.id: agent.name for agent in scene.agents}
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
    return make_printable(f"{agent.name}: {agent.subtype or agent.type}, {way}{action}", limit=110)


def _draw_legend(figure: Figure, rows: list[list[tuple[str, str, str]]], height: float) -> None:
    axes = figure.add_axes((0, 0, 1, 0.2 * len(rows) / height))
    axes.set_xlim(0, WIDTH)
    axes.set_ylim(0.2 * len(rows), 0)
    axes.axis("off")
    for number, row in enumerate(rows):
        x, y = MARGIN + 0.12, 0.2 * number + 0.04
        for symbol, colour, words in row:
            _draw_symbol(axes, symbol, colour, x, y)
            text = axes.text(x + 0.2, y, make_drawable(words), fontsize=8, color=INK, va="center")
            x += 0.45 + text.get_window_extent().width / figure.dpi


def _draw_symbol(axes: Axes, symbol: str, colour: str, x: float, y: float) -> None:
    from matplotlib.patches import FancyBboxPatch

    if symbol == "vehicle":
        axes.add_patch(
            FancyBboxPatch(
                (x - 0.1, y - 0.04),
                0.2,
                0.08,
                facecolor=colour,
                lw=0,
                boxstyle="round,pad=0,rounding_size=0.02",
            )
        )
        return
    size, edge = {"pedestrian": (36, "white"), "dot": (9, INK), "light": (30, INK)}[symbol]
    draw_points(axes, [(x, y)], s=size, c=colour, edgecolors=edge, linewidths=0.9)
