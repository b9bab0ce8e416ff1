"""Precision and recall of `find` on windows of real recordings that were labelled by hand.

The labels' facts are in find_windows.jsonl: a recording, two agents, a span, and what happens
between them (`label`), as told from pictures without having seen what the program says, and where
that differed, what the distances of the footprints say (`read`). The recordings
themselves are not part of this package: TAF-BW (CC BY-NC-SA 4.0) and VTP-TL (Apache-2.0).

    python benchmarks/find.py convert DATA OUT     tables of tracks from the recordings
    python benchmarks/find.py draw OUT SHEETS      windows drawn by chance, as pictures to label
    python benchmarks/find.py score OUT            what `find` finds there, against the labels
"""

from __future__ import annotations

import csv
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from robustness import compute_wilson

from scenewright.errors import Unsatisfiable
from scenewright.graph.find import find_hits, load_sources, read_query
from scenewright.graph.verify import load_tracks

_load = cache(load_tracks)
LABELS = Path(__file__).with_name("find_windows.jsonl")
PIXEL, FRAME = 0.055, 1 / 30
"""Of VTP-TL, whose files state neither: [m], [s]."""
WANTED = {"one_lane": 40, "crossing": 56, "near": 24}
"""Windows by what the geometry of the two tracks is, whatever happens."""
TEXTS = {"follow": "A {} follows a {}", "yield": "A {} yields to a {}",
         "near_miss": "A {} nearly hits a {}"}  # fmt: skip
NOUNS = {"car": "car", "truck": "truck", "bicycle": "cyclist", "pedestrian": "pedestrian"}


def convert(data: Path, out: Path) -> None:
    """A table that `verify` reads for every recording."""
    out.mkdir(parents=True, exist_ok=True)
    for file in sorted(data.glob("taf-bw/datasets/recorded_trackfiles/*/vehicle_tracks_*.csv")):
        with file.open(encoding="utf-8", newline="") as stream:
            rows = [
                (int(r["timestamp_ms"]) / 1000, r["track_id"], r["agent_type"], r["x"], r["y"])
                for r in csv.DictReader(stream)
            ]
        _write(out / f"{file.parent.name[:9]}_{file.stem[-3:]}.csv", rows)
    for file in sorted(data.glob("vtp-tl-crossroad/*.txt")):
        table = np.loadtxt(file)[:, :4]
        rows = [
            (f * FRAME, int(n), "car", x * PIXEL, -y * PIXEL)
            for f, n, x, y in table.tolist()
            if f % 3 == 0
        ]
        _write(out / f"{file.stem}.csv", rows)


def _write(file: Path, rows: list[tuple[Any, ...]]) -> None:
    """The rows by agent, without second ones of a time, smoothed as `verify` advises (0.3 s)."""
    agents: dict[str, dict[float, tuple[Any, ...]]] = {}
    for row in rows:
        agents.setdefault(str(row[1]), {}).setdefault(round(row[0], 2), row)
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(("t", "id", "class", "x", "y"))
        for name, own in agents.items():
            t = np.array(sorted(own))
            xy = np.array([own[time][3:5] for time in t], dtype=np.float64)
            weight = np.exp(-0.5 * ((t[:, None] - t) / 0.3) ** 2)
            # Of a line through the neighbours, so that ends stay where they are.
            for k, time in enumerate(t):
                line = np.polyfit(t - time, xy, 1, w=np.sqrt(weight[k])) if len(t) > 3 else [xy[k]]
                x, y = line[-1]
                writer.writerow((time, name, own[time][2], round(x, 3), round(y, 3)))


def _list_windows(file: Path) -> Iterator[dict[str, Any]]:
    """Pairs that come near one another, by the geometry of their tracks."""
    tracks = load_tracks(file)
    for a, b in combinations(tracks.users, 2):
        start, end = max(a.track.start, b.track.start), min(a.track.end, b.track.end)
        if {a.shape.type, b.shape.type} == {"pedestrian"} or end - start < -8.0:
            continue
        (xa, ya), (xb, yb) = a.track.xy.T, b.track.xy.T
        away = np.hypot(xa[:, None] - xb, ya[:, None] - yb)
        i, j = np.unravel_index(int(np.argmin(away)), away.shape)
        times = a.track.start + i * tracks.step, b.track.start + j * tracks.step
        turn = abs(np.angle(np.exp(1j * (a.track.heading[i] - b.track.heading[j]))))
        moved = min(np.ptp(each.track.xy, axis=0).max() for each in (a, b))
        if moved < 5.0 and "pedestrian" not in (a.shape.type, b.shape.type):
            continue
        kind = None
        if away[i, j] < 1.0 and turn > np.radians(30) and abs(times[0] - times[1]) < 8.0:
            kind, middle = "crossing", sum(times) / 2
        elif end - start > 3.0:
            t = np.arange(start, end, 0.1)
            pair = [
                np.stack(
                    [
                        np.interp(
                            t,
                            u.track.start + tracks.step * np.arange(len(u.track.xy)),
                            u.track.xy[:, k],
                        )
                        for k in (0, 1)
                    ],
                    1,
                )
                for u in (a, b)
            ]
            gap = np.hypot(*(pair[0] - pair[1]).T)
            middle = float(t[int(np.argmin(gap))])
            near = int((gap < 25.0).sum())
            if away[i, j] < 1.5 and turn < np.radians(30) and near > 30 and moved > 10.0:
                kind = "one_lane"
            elif gap.min() < 12.0:
                kind = "near"
        if kind is not None:
            yield {"file": file.name, "agents": [tracks.names[a.id], tracks.names[b.id]],
                   "classes": [tracks.subtypes[a.id], tracks.subtypes[b.id]], "kind": kind,
                   "span": [round(middle - 10, 1), round(middle + 10, 1)]}  # fmt: skip


def draw(out: Path, sheets: Path) -> None:
    """Windows drawn by chance, each recording with its share, and pictures of them."""
    rng = np.random.default_rng(44)
    found = [w for file in sorted(out.glob("*.csv")) for w in _list_windows(file)]
    print(Counter((w["file"][:9], w["kind"]) for w in found))
    chosen = []
    for kind, many in WANTED.items():
        own = [w for w in found if w["kind"] == kind]
        groups = Counter((w["file"][:4], *sorted(w["classes"])) for w in own)
        weight = np.array([groups[w["file"][:4], *sorted(w["classes"])] ** -0.7 for w in own])
        picked = rng.choice(len(own), min(many, len(own)), False, weight / weight.sum())
        chosen += [own[k] for k in picked]
    order = rng.permutation(len(chosen))
    rows = [{"n": n, "half": "development" if n % 2 else "test", **chosen[k]}
            for n, k in enumerate(order)]  # fmt: skip
    sheets.mkdir(parents=True, exist_ok=True)
    (sheets / "windows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    for first in range(0, len(rows), 6):
        _draw_sheet(rows[first : first + 6], out, sheets / f"{first:03}.png")


def _draw_sheet(rows: list[dict[str, Any]], out: Path, target: Path) -> None:
    """Ways of both agents with the time at each second, their speeds and distance below."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(4, 3, figsize=(18, 17), height_ratios=(3, 1, 3, 1))
    for k, row in enumerate(rows):
        way, speeds = axes[2 * (k // 3), k % 3], axes[2 * (k // 3) + 1, k % 3]
        tracks = _load(out / row["file"])
        low, high = row["span"]
        middle, shown = (low + high) / 2, []
        for user in tracks.users:
            times = user.track.start + tracks.step * np.arange(len(user.track.xy))
            inside = (times >= low) & (times <= high)
            name = tracks.names[user.id]
            if not inside.any():
                continue
            xy, t = user.track.xy[inside], times[inside]
            if name not in row["agents"]:
                at = int(np.argmin(abs(t - middle)))
                way.plot(*xy.T, color="0.85", lw=1, zorder=0)
                way.plot(*xy[at], "s" if user.shape.type == "vehicle" else ".", color="0.6", ms=5)
                way.text(*xy[at], f"{t[at]:.0f}", color="0.5", fontsize=6, clip_on=True)
                continue
            colour = ("tab:blue", "tab:red")[row["agents"].index(name)]
            shown.append(xy)
            way.plot(*xy.T, color=colour, lw=1.5)
            last = -1.0
            for one, (x, y) in zip(t, xy, strict=True):
                if abs(one - round(one)) < tracks.step / 2 and round(one) != last:
                    last = round(one)
                    way.plot(x, y, ".", color=colour)
                    way.text(x, y, f"{one:.0f}", color=colour, fontsize=9, clip_on=True)
            window = max(round(0.5 / tracks.step), 1)
            if len(xy) > window:
                v = np.hypot(*(xy[window:] - xy[:-window]).T) / (window * tracks.step)
                speeds.plot(t[window:] - window * tracks.step / 2, v, color=colour)
        points = np.concatenate(shown)
        centre = (points.max(axis=0) + points.min(axis=0)) / 2
        half = min(max(float(np.ptp(points, axis=0).max()) / 2 + 4, 12), 45)
        way.set_xlim(centre[0] - half, centre[0] + half)
        way.set_ylim(centre[1] - half, centre[1] + half)
        way.set_aspect("equal")
        blue, red = row["classes"]
        way.set_title(f"{row['n']}: blue {blue}, red {red}", fontsize=11)
        speeds.grid()
    figure.subplots_adjust(0.03, 0.03, 0.99, 0.97, 0.1, 0.12)
    figure.savefig(target, dpi=75)
    plt.close(figure)


def _format_share(good: int, n: int) -> str:
    if not n:
        return "none"
    low, high = compute_wilson(good, n)
    return f"{good}/{n} = {good / n:.2f} [{low:.2f}, {high:.2f}]"


def score(out: Path) -> None:
    """Precision and recall by half; each label and each hit in a window counts once.

    `read` is after the labels that differed were read again beside the measured distances.
    """
    rows = [json.loads(line) for line in LABELS.read_text("utf-8").splitlines()]
    sources = {name: list(load_sources(out / name)) for name in {row["file"] for row in rows}}
    pairs = {tuple(row["classes"]) for row in rows} | {tuple(row["classes"][::-1]) for row in rows}
    found: dict[str, list[tuple[str, list[str], float, float]]] = {name: [] for name in sources}
    for relation, text in TEXTS.items():
        for one, other in sorted(pairs):
            try:
                query = read_query(text.format(NOUNS[one], NOUNS[other]))
            except Unsatisfiable:  # a pedestrian follows no car
                continue
            for name, own in sources.items():
                hits = (hit for source in own for hit in find_hits(query, source))
                for hit in (hit for hit in hits if not hit.untested):
                    names = [hit.source.tracks.names[n] for n in hit.agents.values()]
                    until = max(float(e.evidence.get("until", e.time)) for e in hit.events)
                    found[name].append((relation, names, hit.time, until))
    counts: Counter[tuple[str, str]] = Counter()
    for row in rows:
        low, high = row["span"]
        blue, red = row["agents"]
        seen = {
            relation if relation == "near_miss" else f"{relation} {'br' if a == blue else 'rb'}"
            for relation, (a, b), time, until in found[row["file"]]
            if {a, b} == {blue, red} and time <= high and until >= low
        }
        blind, read = set(row["label"]), set(row.get("read", row["label"]))
        for half, labels in ((row["half"], blind), ("both", blind), ("read", read)):
            counts[half, "windows"] += 1
            for relation in (*TEXTS, "all"):
                mine = {e for e in labels if relation in ("all", e.partition(" ")[0])}
                ours = {e for e in seen if relation in ("all", e.partition(" ")[0])}
                counts[half, f"{relation} true"] += len(mine & ours)
                counts[half, f"{relation} found"] += len(ours)
                counts[half, f"{relation} there"] += len(mine)
        if read != seen:
            print(row["n"], row["file"], row["agents"], row["kind"], "label", sorted(read),
                  "found", sorted(seen))  # fmt: skip
    for half in ("development", "test", "both", "read"):
        print(half, counts[half, "windows"], "windows")
        for relation in (*TEXTS, "all"):
            true, *of = (counts[half, f"{relation} {what}"] for what in ("true", "found", "there"))
            precision, recall = (_format_share(true, each) for each in of)
            print(f"  {relation}: precision {precision}, recall {recall}")


if __name__ == "__main__":
    commands: dict[str, Callable[..., None]] = {"convert": convert, "draw": draw, "score": score}
    commands[sys.argv[1]](*map(Path, sys.argv[2:]))
