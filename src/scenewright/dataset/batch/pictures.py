"""The pictures of a dataset's card: where, when, how close, how fast."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.dataset.tables.coverage import Covered

COLOURS = {
    "collision": "#D55E00",
    "near_miss": "#E69F00",
    "yielding": "#0072B2",
    "follow": "#009E73",
}
VIEW = (-45.0, 45.0, -45.0, 45.0)
_BINS = 30


def create_figure(width: float, height: float) -> Any:
    """An empty figure [inches] that is drawn without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def draw_overview(
    path: Path,
    *,
    places: Mapping[str, Sequence[float]],
    agents: Mapping[int, int],
    name: str | None,
) -> None:
    """Writes a PNG; the same values give the same bytes.

    Args:
        places: event type -> x [m], y [m], time [s] of every event of it, one after the other.
        agents: number of agents in a scene -> how many scenes have it.
        name: the intersection that is drawn beneath; None for none.
    """
    from matplotlib.image import imread

    figure = create_figure(11.5, 4.2)
    where, when, size = figure.subplots(1, 3, width_ratios=(1.2, 1, 1))
    kinds = [kind for kind in COLOURS if len(places.get(kind, ()))]
    where.set(title="where events happen", xlabel="x [m]", ylabel="y [m]", aspect="equal")
    if name is not None:
        from scenewright.intersections import load_map
        from scenewright.viz.basemap import draw_basemap
        from scenewright.viz.drawing import Drawing

        ground = Drawing(VIEW, 0.0, 0.0, 4.0, 4.0)
        draw_basemap(ground, load_map(name))
        where.imshow(imread(BytesIO(ground.render(150))), extent=VIEW)
    for kind in kinds:
        x, y = places[kind][0::3], places[kind][1::3]
        label = f"{kind.replace('_', ' ')} ({len(x)})"
        where.scatter(x, y, s=8, c=COLOURS[kind], label=label, zorder=9)
    if kinds:
        where.legend(fontsize=7, loc="upper right").set_zorder(10)
    colours = [COLOURS[kind] for kind in kinds]
    if kinds:
        times = [list(places[kind][2::3]) for kind in kinds]
        when.hist(times, bins=_BINS, range=(0, 30), stacked=True, color=colours)
    when.set(title="when events happen", xlabel="time in the scene [s]", ylabel="events")
    size.bar(list(agents), list(agents.values()), color="#6C8EBF")
    size.set(title="agents in a scene", xlabel="agents", ylabel="scenes")
    figure.savefig(path, metadata={"Software": None})


def draw_coverage(path: Path, covered: Sequence[Covered], *, columns: int = 3) -> None:
    """Writes a PNG with the counts of all bins; those with too few are named in orange."""
    lines = [covered[k : k + columns] for k in range(0, len(covered), columns)]
    heights = [3 + max(len(each.counts) for each in line) for line in lines]
    figure = create_figure(4.2 * columns, 0.19 * sum(heights))
    grid = figure.subplots(len(lines), columns, squeeze=False, height_ratios=heights)
    for axes in grid.flat[len(covered) :]:
        axes.set_axis_off()
    for axes, each in zip(grid.flat, covered, strict=False):
        axes.barh(range(len(each.counts)), list(each.counts.values()), color=COLOURS["yielding"])
        axes.set_yticks(range(len(each.counts)), list(map(" and ".join, each.counts)), fontsize=7)
        for tick, bin_ in zip(axes.get_yticklabels(), each.counts, strict=True):
            tick.set_color(COLOURS["collision"] if bin_ in each.gaps else "black")
        axes.invert_yaxis()
        axes.set_title(each.name, fontsize=9)
    figure.savefig(path, metadata={"Software": None})


_PLOTTED = (
    ("post-encroachment time of ", "s", (0.0, 6.0)),
    ("least time to collision along paths of ", "s", (0.0, 6.0)),
    ("mean speed of moving ", "m/s", (0.0, 15.0)),
    ("seen in a scene: ", "agents", (0.0, 40.0)),
)
"""Beginning of a figure's name, its unit, and what its histogram spans."""


def draw_statistics(path: Path, figures: Mapping[str, Sequence[float]]) -> None:
    """Writes histograms as a PNG; the same values give the same bytes.

    Args:
        figures: name with its unit -> values.
    """
    figure = create_figure(11.5, 2.9)
    all_axes = figure.subplots(1, len(_PLOTTED))
    for axes, (begin, unit, span) in zip(all_axes, _PLOTTED, strict=True):
        for name, values in sorted(figures.items()):
            if name.startswith(begin):
                label = name.removeprefix(begin).rpartition(" [")[0]
                axes.hist(np.array(values), bins=24, range=span, histtype="stepfilled", alpha=0.5,
                          label=label)  # fmt: skip
        axes.set(xlabel=f"{begin.removesuffix(' of ').strip(': ')} [{unit}]", xlim=span)
        if axes.patches:
            axes.legend(fontsize=7)
    all_axes[0].set_ylabel("how many")
    figure.savefig(path, metadata={"Software": None})
