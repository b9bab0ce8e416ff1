"""An intersection alone: its map, legs, movements and lights, and what was recorded or sampled."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from scenewright.files import write_atomically
from scenewright.geometry.polyline import interpolate_points
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Leg
from scenewright.viz.appearance import FOREGROUND, make_printable
from scenewright.viz.basemap import KeyEntry, draw_basemap, draw_key, draw_north, draw_scale
from scenewright.viz.drawing import INK, SOFT_INK, Drawing, create_page
from scenewright.viz.fonts import find_unshown

_INSET = 0.86
"""Of the way from the middle of the picture to its edge, for the middle of a label."""


def place_leg_label(intersection: IntersectionMap, leg: Leg) -> tuple[FloatArray, float]:
    """Where a leg's label stands [2] [m], on its own lanes near the edge, and its turn [degrees].

    Labels of legs that run up or down the picture lie across them; others run along their leg.
    """
    points = [
        np.array(lane.centreline)
        for lane in intersection.lanelets
        if lane.leg == leg.name and lane.kind in ("approach", "exit")
    ]
    inside = [
        line[np.abs(line).max(axis=1) <= _INSET * intersection.extent + 1.0] for line in points
    ]
    far = [line[np.abs(line).max(axis=1).argmax()] for line in inside if len(line)]
    at = np.mean(far, axis=0) if far else np.zeros(2)
    turn = (np.rad2deg(leg.bearing) + 90.0) % 180.0 - 90.0
    return np.asarray(at), float(turn) if abs(turn) < _STEEP else 0.0


_STEEP = 50.0
"""Legs that lie steeper in the picture have their labels across them [degrees]."""


def name_leg(leg: Leg) -> str:
    """Its compass name, and its street where it has one that an installed font shows."""
    if find_unshown(leg.road) or leg.road in ("", f"{leg.name} road"):
        return leg.name
    return f"{leg.name} · {leg.road}"


def name_place(intersection: IntersectionMap) -> str:
    """The title; where no font has its letters, how many legs there are."""
    if find_unshown(intersection.title):
        return f"{len(intersection.legs)} legs"
    return intersection.title


def list_unshown_streets(intersection: IntersectionMap) -> Iterator[str]:
    """One line, where no installed font shows the letters of streets."""
    unshown = sorted({leg.road for leg in intersection.legs if find_unshown(leg.road)})
    if unshown:
        yield (
            f"no font on this machine shows the names of {len(unshown)} streets; legs bear their "
            "compass names alone (install one, such as Noto Sans CJK)"
        )


SIZE = 8.0
KEY_COLUMNS = 6
TRACK = "#5B6573"
SAMPLE = "#AA3377"
_DASHES = "2.1 1.7"


def draw_intersection(
    path: str | Path,
    *,
    intersection: IntersectionMap,
    tracks: Sequence[FloatArray] | None = None,
    samples: Sequence[FloatArray] | None = None,
    dpi: int = 150,
) -> None:
    """Draw an intersection as one PNG: legs, movements coloured by signal group, lights.

    Args:
        tracks: [T, 2] recorded positions each [m], drawn thin and grey.
        samples: [N, 2] sampled paths each [m], drawn thin and purple.

    Raises:
        InputError: the file cannot be written; nothing is left behind.
    """
    tracks, samples = tracks or (), samples or ()
    side, half = 0.94 * SIZE, intersection.extent
    shades = choose_group_colours(intersection)
    key = [KeyEntry(make_printable(name, limit=40), shade, 2) for name, shade in shades.items()]
    key.append(KeyEntry("crosswalk", SOFT_INK, 1.4, _DASHES))
    key += [KeyEntry(f"{len(tracks)} recorded tracks", TRACK, 1)] if len(tracks) else []
    key += [KeyEntry(f"{len(samples)} samples", SAMPLE, 1)] if len(samples) else []
    page = create_page(SIZE, 0.58 + side + (0.3 if len(key) <= KEY_COLUMNS else 0.5))
    axes = page.add_map((-half, half, -half, half), 0.03 * SIZE, 0.58, side, side)
    draw_basemap(axes, intersection)
    for curves, colour, order in ((tracks, TRACK, 4), (samples, SAMPLE, 5)):
        strength = float(np.clip(24.0 / max(len(curves), 1), 0.16, 0.6))
        for curve in curves:
            axes.draw([curve], order=order, stroke=colour, stroke_width=0.6,
                      stroke_opacity=strength)  # fmt: skip
    _draw_movements(axes, intersection, shades, faint=len(tracks) + len(samples) > 0)
    goals = [goal.polygon for goal in intersection.goal_regions]
    axes.draw(goals, closed=True, order=5, fill="#198059", fill_opacity=0.1, stroke="#15803D",
              stroke_width=0.7, stroke_dasharray="1.4 1.05")  # fmt: skip
    _write_leg_names(axes, intersection)
    draw_scale(axes)
    draw_north(axes)
    _draw_header(page, intersection)
    draw_key(page, key, 0.58 + side + 0.15, columns=KEY_COLUMNS)
    write_atomically(path, page.render(dpi))


def choose_group_colours(intersection: IntersectionMap) -> dict[str, str]:
    """`#RRGGBB` by signal group, with `unsignalised` for movements that have none."""
    groups = intersection.signals.groups if intersection.signals else ()
    shades = {group.id: FOREGROUND[i % len(FOREGROUND)] for i, group in enumerate(groups)}
    free = any(movement.signal_group is None for movement in intersection.movements)
    return shades | ({"unsignalised": INK} if free else {})


def _draw_movements(
    axes: Drawing, intersection: IntersectionMap, shades: dict[str, str], *, faint: bool
) -> None:
    lights = {
        walk: g.id
        for g in (intersection.signals.groups if intersection.signals else ())
        for walk in g.crosswalks
    }
    for movement in intersection.movements:
        colour = shades[movement.signal_group or "unsignalised"]
        strength = 0.45 if faint else 0.9
        line = np.array(movement.centreline, dtype=float)
        axes.draw([line], order=6, stroke=colour, stroke_width=1.1, stroke_opacity=strength)
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        for place in (min(12.0, s[-1] / 3), s[-1] - min(12.0, s[-1] / 3)):
            tail, tip = interpolate_points(np.array([place - 1.0, place + 1.0]), s, line)
            ahead = (tip - tail) / max(float(np.linalg.norm(tip - tail)), 1e-9) / axes.scale
            aside = np.array([-ahead[1], ahead[0]])
            head = [tip, tip - 3.6 * ahead + 1.8 * aside, tip - 3.6 * ahead - 1.8 * aside]
            axes.draw([head], closed=True, order=7, fill=colour, fill_opacity=strength)
    for walk in intersection.crosswalks:
        colour = shades.get(lights.get(walk.id, ""), SOFT_INK)
        axes.draw([walk.centreline], order=6, stroke=colour, stroke_width=1.4,
                  stroke_dasharray=_DASHES)  # fmt: skip


def _write_leg_names(axes: Drawing, intersection: IntersectionMap) -> None:
    """Compass name and road of every leg, on the ground beside its sidewalk."""
    half = intersection.extent
    kerb = np.vstack(
        [np.array(area.exterior) for area in intersection.walkable + intersection.road]
    )
    for leg in intersection.legs:
        angle = _find_label_angle(leg, intersection)
        ahead = np.array([np.cos(angle), np.sin(angle)])
        left = np.array([-ahead[1], ahead[0]])
        aside = left if left[0] + 0.9 * left[1] > 0 else -left
        own = (kerb @ aside)[(kerb @ ahead > 0.6 * half) & (np.abs(kerb @ aside) < half / 2)]
        at = 0.97 * half * ahead + (float(own.max() if len(own) else 4.0) + 1.0) * aside
        at = np.clip(at, -0.97 * half, 0.95 * half)
        starts = aside[0] > ahead[0] if abs(at[0]) <= 0.5 * half else at[0] < 0
        axes.write(
            make_printable(name_leg(leg), limit=70), at, 8.5, align="start" if starts else "end",
            above=1.0 if aside[1] > ahead[1] else 0.0, bold=True, halo="white", order=20,
        )  # fmt: skip


def _find_label_angle(leg: Leg, intersection: IntersectionMap) -> float:
    """Where a leg's name stands [rad]: in its direction, or where it leaves the map if it bends."""
    ends = [
        lane.centreline[0 if lane.kind == "approach" else -1]
        for lane in intersection.lanelets
        if lane.leg == leg.name and lane.kind in ("approach", "exit")
    ]
    if not ends:
        return leg.bearing
    x, y = np.mean(ends, axis=0)
    leaves = float(np.arctan2(y, x))
    return leaves if abs(math.remainder(leaves - leg.bearing, math.tau)) > _BENT else leg.bearing


_BENT = 0.26
"""Legs that leave the map so far off their direction at the junction are bent [rad]."""


def _draw_header(page: Drawing, intersection: IntersectionMap) -> None:
    counts = (
        f"{intersection.name}   ·   {len(intersection.legs)} legs, "
        f"{len(intersection.movements)} movements, {len(intersection.crosswalks)} crosswalks"
    )
    signals = intersection.signals
    counts += f", signals with a cycle of {signals.cycle:.0f} s" if signals else ", no signals"
    left = 0.03 * SIZE
    page.write(make_printable(name_place(intersection), limit=90), (left, 0.1), 12, above=0.0)
    page.write(make_printable(counts, limit=140), (left, 0.34), 8.5, above=0.0, fill=SOFT_INK)
