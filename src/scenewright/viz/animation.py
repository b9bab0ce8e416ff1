"""A scene in motion: an animated GIF."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

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
    is_night,
    list_motions,
    make_printable,
)
from scenewright.viz.basemap import draw_basemap, draw_north, draw_scale
from scenewright.viz.drawing import INK, SOFT_INK, Drawing, create_page, measure_block
from scenewright.viz.label_placement import LabelLayout
from scenewright.viz.painting import paint
from scenewright.viz.road_markings import find_light_positions
from scenewright.viz.still import EVENT_WORDS, compute_windscreen, draw_fading_lines, draw_objects

SLOW = 1 / 3
"""Speed at which the moments round an event are shown, as a share of real time."""
BEFORE, AFTER = 1.2, 0.8
"""How long [s] before and after an event the animation is slow."""
ENDING = 2.0
"""How long [s] an animation goes on after the last event."""


def choose_frame_times(scene: SceneRecord, *, fps: int, whole: bool = False) -> FloatArray:
    """[N] the moment of every frame [s]: slow round each event, ending soon after the last.

    Args:
        whole: show the scene to its end.
    """
    events = [event.time for event in scene.events if event.time is not None]
    duration = scene.meta.duration
    end = duration if whole or not events else min(max(events) + ENDING, duration)
    grid = np.arange(0.0, end + 1e-9, 0.01)
    slow = np.zeros(len(grid), dtype=bool)
    for time in events:
        slow |= (grid >= time - BEFORE) & (grid <= time + AFTER)
    shown = np.concatenate([[0.0], np.cumsum(np.where(slow, 1 / SLOW, 1.0) * 0.01)[:-1]])
    return np.asarray(np.interp(np.arange(0.0, shown[-1] + 1e-9, 1.0 / fps), shown, grid))


SIDE = 5.4
HEAD = 0.5
TRAIL = 3.0
FLASH = 2.5
"""How long [s] a trail reaches back, and how long an event stays marked."""

LEAST_WIDTH = 0.02
"""Width of a pedestrian, as a share of the picture; in true size it would be invisible."""

UNUSED = 255
"""The palette entry of pixels that stay as they were."""

SMOOTH = 3
"""Frames are painted in so many times the pixels each way."""

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
    animated = AnimatedScene(scene, proof, intersection)
    few = [animated.render_frame(float(t)) for t in times[:: max(1, len(times) // 8)][:9]]
    data = _encode_gif(
        (animated.render_frame(float(t)) for t in times), palette=_choose_palette(few), fps=fps
    )
    write_atomically(path, data)


@dataclass(frozen=True, slots=True)
class EventMark:
    """An event [s] with its place and its words at theirs [2] [m], which take a box [m]."""

    time: float
    spot: FloatArray
    words: str
    at: FloatArray
    box: Box


class AnimatedScene:
    """The still map in memory, and drawings of what moves over it."""

    def __init__(
        self, scene: SceneRecord, proof: Proof | None, intersection: IntersectionMap, *,
        dpi: int = 100,
    ) -> None:  # fmt: skip
        from PIL import Image

        self.scene = scene
        self.zoom = dpi * SMOOTH
        self.moving = list_motions(scene)
        self.view = choose_view(scene, self.moving, intersection)
        self.lights = find_light_positions(intersection)
        self.still = create_page(SIDE + 0.2, SIDE + HEAD + 0.1)
        axes = self.still.add_map(self.view, 0.1, HEAD, SIDE, SIDE)
        draw_basemap(axes, intersection, night=is_night(scene))
        draw_objects(axes, scene)
        draw_scale(axes)
        draw_north(axes)
        _draw_header(self.still, scene, proof)
        ground = Image.open(BytesIO(self.still.render(self.zoom))).convert("RGB")
        left, top, side = (round(each * dpi) * SMOOTH for each in (0.1, HEAD, SIDE))
        self.map = ground.crop((left, top, left + side, top + side))
        self.page = ground.reduce(SMOOTH)
        self.corner = left // SMOOTH, top // SMOOTH
        self.marks = self._place_event_marks()

    def render_frame(self, time: float) -> Pixels:
        """[H, W, 3] the scene at a time [s]."""
        moving, frame = self.map.copy(), self.page.copy()
        paint(self.draw_moving(time), moving, self.zoom / 72)
        frame.paste(moving.reduce(SMOOTH), self.corner)
        return np.asarray(frame)

    def draw_moving(self, time: float) -> Drawing:
        """The map's place with what moves or comes and goes, at a time [s]."""
        axes = Drawing(self.view, 0.0, 0.0, SIDE, SIDE)
        for name, light in find_light_colours(self.scene, time).items():
            spots = self.lights.get(name, [])
            size = 5.1 if len(spots) == 1 else 3.7
            axes.mark(spots, size, fill=LIGHTS[light], stroke=INK, stroke_width=1.0)
        west, east, south, north = self.view
        least = LEAST_WIDTH * (east - west)
        trails: dict[tuple[str, float], list[FloatArray]] = {}
        bodies: dict[str, list[FloatArray]] = {}
        panes: list[FloatArray] = []
        named: list[tuple[DrawnMotion, Box]] = []
        for motion in self.moving:
            index = motion.find_sample(time)
            if index is None:
                continue
            outline = motion.compute_outline(index, least)
            trail = motion.xy[max(0, index - round(TRAIL / self.scene.meta.step)) : index + 1]
            if not _overlap(_bound(np.vstack([outline, trail])), (west, south, east, north)):
                continue
            strength = 0.9 if motion.is_foreground else 0.5
            trails.setdefault((motion.colour, strength), []).append(trail)
            bodies.setdefault(motion.colour, []).append(outline)
            panes += [compute_windscreen(motion, index)] * (motion.agent.type != "pedestrian")
            named += [(motion, _bound(outline))] * motion.is_foreground
        for (colour, strength), lines in trails.items():
            draw_fading_lines(axes, lines, colour, strength * np.arange(1, 6) / 5, width=2.0)
        for colour, outlines in bodies.items():
            axes.draw(outlines, closed=True, fill=colour, stroke="white", stroke_width=0.7)
        axes.draw(panes, closed=True, fill="white", fill_opacity=0.75)
        corner = west + 0.035 * (east - west), north - 0.035 * (east - west)
        axes.write(f"{time:.1f} s", corner, 11, above=0.0, box=("white", "#C9CCD1"))
        shown = [mark for mark in self.marks if mark.time - 1e-6 <= time <= mark.time + FLASH]
        for motion, box in self.place_names(axes, named, [mark.box for mark in shown]):
            axes.write(motion.called, box[:2], 8, above=1.0, bold=True, halo="white",
                       fill=motion.colour)  # fmt: skip
        for mark in shown:
            axes.mark(mark.spot, 26.5, stroke=INK, stroke_width=1.6)
            axes.write(mark.words, mark.at, 9, align="middle", bold=True, box=("#FFF4CC", INK))
        return axes

    def place_names(
        self, axes: Drawing, named: list[tuple[DrawnMotion, Box]], taken: list[Box]
    ) -> Iterator[tuple[DrawnMotion, Box]]:
        """Names inside the picture, each on the first side of its agent that is not taken."""
        west, east, south, north = self.view
        boxes = list(taken)
        for motion, body in named:
            x, y = (body[0] + body[2]) / 2, (body[1] + body[3]) / 2
            if west <= x <= east and south <= y <= north:
                words = [motion.called]
                size = np.array(measure_block(words, 8, bold=True)) / axes.scale
                others = [other for who, other in named if who is not motion]
                boxes.append(self._choose_box(body, size, [*boxes, *others]))
                yield motion, boxes[-1]

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

    def _place_event_marks(self) -> list[EventMark]:
        event_marks: list[EventMark] = []
        for event in self.scene.events:
            if event.time is None or event.location is None:
                continue
            spot = np.array(event.location, dtype=float)
            layout = LabelLayout(
                Drawing(self.view, 0.0, 0.0, SIDE, SIDE), boxes=[mark.box for mark in event_marks]
            )
            for motion in self.moving:
                near = (motion.times >= event.time) & (motion.times <= event.time + FLASH)
                layout.avoid(motion.xy[near])
            words = f"{EVENT_WORDS[event.type]} · {event.time:.1f} s"
            at = layout.reserve(words, spot, 9, (3.4, 5.0), bold=True, boxed=True)
            event_marks.append(EventMark(event.time, spot, words, at, layout.boxes[-1]))
        return event_marks


def _bound(outline: FloatArray) -> Box:
    (west, south), (east, north) = outline.min(axis=0), outline.max(axis=0)
    return float(west), float(south), float(east), float(north)


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _draw_header(page: Drawing, scene: SceneRecord, proof: Proof | None) -> None:
    words = textwrap.wrap(make_printable(scene.meta.user_prompt, limit=200), 92) or [
        "Untitled scene"
    ]
    if len(words) > 2:
        words = [words[0], words[1] + " …"]
    size = 7.8 / max(1.0, measure_block(words, 7.8)[0] / (SIDE * page.scale))
    page.write("\n".join(words), (0.1, 0.1), size, above=0.0)
    verdict = "" if proof is None else f"  {proof.describe_verdict()}"
    colour = SOFT_INK if proof is None else colour_verdict(proof)
    facts = make_printable(scene.meta.scene_id + verdict, limit=100)
    page.write(facts, (SIDE + 0.1, HEAD - 0.03), 6.5, align="end", above=1.0, fill=colour)


def _encode_gif(frames: Iterator[Pixels], *, palette: bytes, fps: int) -> bytes:
    """An animated GIF with one palette for all frames; pixels that stay are not sent again."""
    from PIL import Image

    # [32768] nearest palette entry of every colour of 5 bits a channel.
    levels = np.arange(32, dtype=np.uint8) * 8 + 4
    cube = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1)
    chart = Image.new("P", (1, 1))
    chart.putpalette(palette[: 3 * UNUSED])
    every = Image.fromarray(cube.reshape(256, 128, 3))
    table = np.asarray(every.quantize(palette=chart, dither=Image.Dither.NONE)).reshape(-1)
    indexed = []
    for pixels in frames:
        red, green, blue = (pixels[:, :, i].astype(np.uint16) >> 3 for i in range(3))
        image = Image.fromarray(table[(red << 10) | (green << 5) | blue], mode="P")
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
