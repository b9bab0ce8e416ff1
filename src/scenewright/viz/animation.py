"""A scene in motion: an animated GIF."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord
from scenewright.viz.appearance import (
    LIGHTS,
    DrawnMotion,
    choose_view,
    colour_verdict,
    find_light_colours,
    list_motions,
    parse_colour,
)
from scenewright.viz.basemap import draw_basemap, draw_north, draw_scale
from scenewright.viz.figure import (
    INK,
    SOFT_INK,
    add_halo,
    add_map_axes,
    create_figure,
    draw_points,
    make_drawable,
    use_plain_style,
)
from scenewright.viz.frame_times import choose_frame_times
from scenewright.viz.label_placement import LabelLayout
from scenewright.viz.road_markings import find_light_positions
from scenewright.viz.still import EVENT_WORDS, compute_windscreen, draw_objects

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PathCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.text import Text

SIDE = 5.4
HEAD = 0.5
TRAIL = 3.0
FLASH = 2.5
"""How long [s] a trail reaches back, and how long an event stays marked."""

LEAST_WIDTH = 0.02
"""Width of a pedestrian, as a share of the picture; in true size it would be invisible."""

UNUSED = 255
"""The palette entry of pixels that stay as they were."""

GAP = 0.4
"""Between an agent and its name, and between a name and the edge [m]."""

FARTHER = 2.5
"""How much farther from its agent a name stands where all nearer places are taken [m]."""

Pixels = NDArray[np.uint8]
Box = tuple[float, float, float, float]
"""West, south, east, north [m]."""


def animate_scene(
    path: str | Path,
    *,
    scene: SceneRecord,
    proof: Proof | None,
    intersection: IntersectionMap,
    fps: int = 10,
    whole: bool = False,
) -> None:
    """Write a scene as a looping GIF: slow round each event, ending soon after the last.

    Args:
        whole: show the scene to its end.

    Raises:
        InputError: the file cannot be written, or `fps` is not from 1 to 50.
    """
    if not 1 <= fps <= 50:
        raise InputError(f"frames per second must be from 1 to 50, got {fps}")
    times = choose_frame_times(scene, fps=fps, whole=whole)
    with use_plain_style():
        animated = AnimatedScene(scene, proof, intersection)
        few = [animated.render_frame(float(t)) for t in times[:: max(1, len(times) // 8)][:9]]
        data = _encode_gif(
            (animated.render_frame(float(t)) for t in times), palette=_choose_palette(few), fps=fps
        )
    write_atomically(path, data)


@dataclass(frozen=True, slots=True)
class EventMark:
    """The ring and the label of an event: shown from its time [s], the label in its box [m]."""

    time: float
    box: Box
    artists: tuple[Artist, Artist]


class AnimatedScene:
    """The still map in memory and the few artists that move over it."""

    def __init__(
        self,
        scene: SceneRecord,
        proof: Proof | None,
        intersection: IntersectionMap,
        *,
        dpi: int = 100,
    ) -> None:
        self.scene = scene
        self.moving = list_motions(scene)
        self.figure = create_figure(SIDE + 0.2, SIDE + HEAD + 0.1, dpi=dpi)
        tall, wide = SIDE + HEAD + 0.1, SIDE + 0.2
        rect = (0.1 / wide, 0.1 / tall, SIDE / wide, SIDE / tall)
        self.axes = add_map_axes(self.figure, rect)
        view = choose_view(scene, self.moving, intersection)
        self.view = view
        self.least = LEAST_WIDTH * (view[1] - view[0])
        draw_basemap(self.axes, intersection, view)
        draw_objects(self.axes, scene)
        draw_scale(self.axes)
        draw_north(self.axes)
        _draw_header(self.figure, scene, proof)
        self.canvas: FigureCanvasAgg = self.figure.canvas  # type: ignore[assignment]
        self.canvas.draw()  # type: ignore[no-untyped-call]
        self.still = self.canvas.copy_from_bbox(self.figure.bbox)  # type: ignore[no-untyped-call]
        self.trails = self._add_trails()
        self.bodies = self._add_polygons(10, edge="white")
        self.panes = self._add_polygons(11, edge="none")
        self.lights, self.lit = self._add_lights(intersection)
        self.clock = self._add_clock()
        self.names = [self._add_name(motion) for motion in self.moving if motion.is_foreground]
        self.marks = self._add_event_marks()

    def render_frame(self, time: float) -> Pixels:
        """[H, W, 3] the scene at a time [s]."""
        self.canvas.restore_region(self.still)  # type: ignore[no-untyped-call]
        for artist in self._update_artists(time):
            self.axes.draw_artist(artist)
        pixels = self.canvas.buffer_rgba()  # type: ignore[no-untyped-call]
        return np.asarray(pixels)[:, :, :3].copy()

    def _update_artists(self, time: float) -> Iterator[Artist]:
        here = [(m, i) for m in self.moving if (i := m.find_sample(time)) is not None]
        self._update_trails(here)
        self.bodies.set_verts([m.compute_outline(i, self.least) for m, i in here])
        self.bodies.set_facecolor([m.colour for m, _ in here])
        self.panes.set_verts(
            [compute_windscreen(m, i) for m, i in here if m.agent.type != "pedestrian"]
        )
        now = find_light_colours(self.scene, time)
        self.lights.set_facecolor([LIGHTS[now[n]] if n in now else "none" for n in self.lit])
        self.lights.set_edgecolor([INK if n in now else "none" for n in self.lit])
        self.clock.set_text(f"{time:4.1f} s")
        yield from (self.lights, self.trails, self.bodies, self.panes, self.clock)
        shown = [mark for mark in self.marks if mark.time - 1e-6 <= time <= mark.time + FLASH]
        yield from self._place_names(here, [mark.box for mark in shown])
        for mark in shown:
            yield from mark.artists

    def _add_trails(self) -> LineCollection:
        from matplotlib.collections import LineCollection

        trails = LineCollection([], linewidths=2.0, capstyle="butt", zorder=9)
        self.axes.add_collection(trails, autolim=False)
        return trails

    def _update_trails(self, here: list[tuple[DrawnMotion, int]]) -> None:
        lines, shades = [], []
        for motion, index in here:
            back = max(0, index - round(TRAIL / self.scene.meta.step))
            for number, part in enumerate(np.array_split(np.arange(back, index + 1), 5)):
                if len(part) > 1:
                    lines.append(motion.xy[part[0] : part[-1] + 2])
                    strength = 0.9 if motion.is_foreground else 0.5
                    colour = np.array(parse_colour(motion.colour)) / 255
                    shades.append((*colour, strength * (number + 1) / 5))
        self.trails.set_segments(lines)
        self.trails.set_color(shades)

    def _add_polygons(self, order: int, *, edge: str) -> PolyCollection:
        from matplotlib.collections import PolyCollection

        shapes = PolyCollection(
            [], facecolor=(1, 1, 1, 0.75), edgecolor=edge, linewidth=0.7, zorder=order
        )
        self.axes.add_collection(shapes, autolim=False)
        return shapes

    def _add_lights(self, intersection: IntersectionMap) -> tuple[PathCollection, list[str]]:
        places = find_light_positions(intersection)
        names = [name for name, spots in places.items() for _ in spots]
        spots = np.array([spot for found in places.values() for spot in found]).reshape(-1, 2)
        sizes = [26 if len(places[name]) == 1 else 14 for name in names]
        return draw_points(self.axes, spots, s=sizes, linewidths=1.0, zorder=8), names

    def _add_clock(self) -> Text:
        return self.axes.text(
            0.025, 0.97, "", transform=self.axes.transAxes, va="top", ha="left", fontsize=11,
            color=INK, zorder=30, fontfamily=["DejaVu Sans Mono", "DejaVu Sans"],
            bbox={"boxstyle": "round,pad=0.3", "facecolor": "white", "edgecolor": "#C9CCD1"},
        )  # fmt: skip

    def _add_name(self, motion: DrawnMotion) -> tuple[int, Text, FloatArray]:
        """An agent's id, its name, and the room that the name takes [m]."""
        text = self.axes.text(0, 0, make_drawable(motion.agent.name, limit=40), fontsize=8,
                              va="bottom", ha="left", fontweight="bold", color=motion.colour,
                              zorder=24, clip_on=True)  # fmt: skip
        extent = text.get_window_extent().transformed(self.axes.transData.inverted())
        return motion.agent.id, add_halo(text), np.array([extent.width, extent.height])

    def _place_names(
        self, here: list[tuple[DrawnMotion, int]], taken: list[Box]
    ) -> Iterator[Artist]:
        """Names inside the picture, each on the first side of its agent that is not taken."""
        at = {motion.agent.id: motion.compute_outline(index) for motion, index in here}
        named = {number: _bound(at[number]) for number, _, _ in self.names if number in at}
        boxes = list(taken)
        for number, text, size in self.names:
            if number in at and self._is_in_view(at[number]):
                others = [body for other, body in named.items() if other != number]
                box = self._choose_box(named[number], size, [*boxes, *others])
                boxes.append(box)
                text.set_position((box[0], box[1]))
                yield text

    def _is_in_view(self, outline: FloatArray) -> bool:
        west, east, south, north = self.view
        x, y = outline.mean(axis=0)
        return bool(west <= x <= east and south <= y <= north)

    def _choose_box(self, body: Box, size: FloatArray, taken: list[Box]) -> Box:
        west, east, south, north = self.view
        low_x, low_y, high_x, high_y = body
        left, below = low_x - size[0] - GAP, low_y - size[1] - GAP
        corners = [
            (x, y)
            for away in (0.0, FARTHER)
            for y in (high_y + GAP + away, below - away)
            for x in (high_x + GAP, left)
        ]
        boxes = [
            (float(np.clip(x, west + GAP, east - size[0] - GAP)),
             float(np.clip(y, south + GAP, north - size[1] - GAP)))
            for x, y in corners
        ]  # fmt: skip
        whole = [(x, y, x + float(size[0]), y + float(size[1])) for x, y in boxes]
        free = (box for box in whole if not any(_overlap(box, other) for other in taken))
        return next(free, whole[0])

    def _add_event_marks(self) -> list[EventMark]:
        """A ring and a label for every event with a time and a place."""
        found: list[EventMark] = []
        for event in self.scene.events:
            if event.time is None or event.location is None:
                continue
            spot = np.array(event.location, dtype=float)
            layout = LabelLayout(self.axes, boxes=[mark.box for mark in found])
            for motion in self.moving:
                near = (motion.times >= event.time) & (motion.times <= event.time + FLASH)
                layout.avoid(motion.xy[near])
            ring: Artist = draw_points(
                self.axes, spot, s=700, facecolors="none", edgecolors=INK, linewidths=1.6, zorder=20
            )
            words = layout.write(
                f"{EVENT_WORDS[event.type]} · {event.time:.1f} s", spot, distances=(3.4, 5.0),
                halo=False, fontsize=9, fontweight="bold", color=INK, zorder=25,
                bbox={"boxstyle": "round,pad=0.3", "facecolor": "#FFF4CC", "edgecolor": INK},
            )  # fmt: skip
            found.append(EventMark(event.time, layout.boxes[-1], (ring, words)))
        return found


def _bound(outline: FloatArray) -> Box:
    (west, south), (east, north) = outline.min(axis=0), outline.max(axis=0)
    return float(west), float(south), float(east), float(north)


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _draw_header(figure: Figure, scene: SceneRecord, proof: Proof | None) -> None:
    words = textwrap.wrap(make_drawable(scene.meta.user_prompt, limit=200), 92) or [
        "Untitled scene"
    ]
    if len(words) > 2:
        words = [words[0], words[1] + " …"]
    tall, wide = figure.get_figheight(), figure.get_figwidth()
    text = figure.text(0.1 / wide, 1 - 0.08 / tall, "\n".join(words), fontsize=7.8, color=INK,
                       va="top", ha="left", linespacing=1.3)  # fmt: skip
    share = text.get_window_extent().width / (figure.dpi * SIDE)
    text.set_fontsize(7.8 / max(1.0, share))
    verdict = "" if proof is None else f"  {proof.describe_verdict()}"
    colour = SOFT_INK if proof is None else colour_verdict(proof)
    figure.text(1 - 0.1 / wide, (SIDE + 0.13) / tall,
                make_drawable(scene.meta.scene_id + verdict, limit=100), fontsize=6.5,
                color=colour, va="bottom", ha="right")  # fmt: skip


def _encode_gif(frames: Iterator[Pixels], *, palette: bytes, fps: int) -> bytes:
    """An animated GIF with one palette for all frames; pixels that stay are not sent again."""
    from PIL import Image

    table = _tabulate_nearest_entries(palette)
    indexed = []
    for pixels in frames:
        image = Image.fromarray(_look_up_entries(pixels, table), mode="P")
        image.putpalette(palette)
        indexed.append(image)
    buffer = BytesIO()
    indexed[0].save(
        buffer, format="GIF", save_all=True, append_images=indexed[1:], loop=0,
        duration=round(1000 / fps), disposal=1, optimize=True, transparency=UNUSED,
    )  # fmt: skip
    return buffer.getvalue()


def _choose_palette(pictures: list[Pixels]) -> bytes:
    """255 colours for these frames, and one spare entry."""
    from PIL import Image

    sample = Image.fromarray(np.vstack([picture[::2, ::2] for picture in pictures]))
    colours = sample.quantize(UNUSED, method=Image.Quantize.MEDIANCUT).getpalette() or []
    return bytes((colours + [0] * 768)[:768])


def _tabulate_nearest_entries(palette: bytes) -> Pixels:
    """[32768] nearest palette entry of every colour of 5 bits a channel."""
    from PIL import Image

    levels = np.arange(32, dtype=np.uint8) * 8 + 4
    cube = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1)
    chart = Image.new("P", (1, 1))
    chart.putpalette(palette[: 3 * UNUSED])
    every = Image.fromarray(cube.reshape(256, 128, 3))
    return np.asarray(every.quantize(palette=chart, dither=Image.Dither.NONE)).reshape(-1)


def _look_up_entries(pixels: Pixels, table: Pixels) -> Pixels:
    red, green, blue = (pixels[:, :, i].astype(np.uint16) >> 3 for i in range(3))
    return np.asarray(table[(red << 10) | (green << 5) | blue])
