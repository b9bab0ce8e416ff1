"""Can a reader tell our tracks from recorded ones? Sheets of pairs, and the key to them.

    python -m lab.blind_pairs --ours DIR --real PATH --kind vehicle --out DIR [--pairs 20]
    python -m lab.blind_pairs --key DIR/key.json --answers FILE

Each pair holds 6 s of a generated track and 6 s of a recorded one that does the same (goes on,
slows down, turns...) with a similar mean speed, in an order drawn by `--seed` and the recording:
the path, turned so that it ends to the right of where it begins, and the speed over time, both
from positions smoothed over 1 s. The answers are a JSON object: number of the pair -> "A" or "B",
the one taken for recorded.
"""

from __future__ import annotations

import argparse
import json
import random
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.driving.benchmark_report import describe_rate
from scenewright.evals.realism.sources import TrackSource, read_source
from scenewright.evals.realism.two_sample import classify_motion
from scenewright.geometry.kinematics import smooth

LENGTH, STEP = 6.0, 0.1
SMOOTHING = 0.29
"""Standard deviation of a mean over 1 s [s]."""
LEAST_MOVED = {"vehicle": 8.0, "pedestrian": 4.0}
MOST_APART = {"vehicle": 1.5, "pedestrian": 0.3}
"""Between the mean speeds of a pair [m/s]."""
ON_A_SHEET = 5
LEAST_HALF_WIDTH = 2.0
"""Half of what a path is drawn in across, at the least [m]: noise of centimetres is not shown."""


def list_pieces(source: TrackSource, kind: str, *, foreground: bool | None) -> list[np.ndarray]:
    """[N, 2] the middle 6 s of every track of a class that moves, from its beginning on."""
    count = round(LENGTH / STEP)
    pieces = []
    for stretch in source.stretches:
        for user in stretch.users:
            if (user.shape.type == "pedestrian") != (kind == "pedestrian"):
                continue
            if foreground and user.id not in stretch.foreground:
                continue
            xy = resample(user.track.xy, user.track.step)
            if len(xy) < count + 10:
                continue
            begin = (len(xy) - count) // 2
            piece = smooth(xy, SMOOTHING)[begin : begin + count]
            if np.linalg.norm(piece[-1] - piece[0]) >= LEAST_MOVED[kind]:
                pieces.append(piece)
    return pieces


def resample(xy: np.ndarray, step: float) -> np.ndarray:
    """[M, 2] positions every 0.1 s."""
    times = np.arange(len(xy)) * step
    wanted = np.arange(0.0, times[-1] + 1e-9, STEP)
    return np.column_stack([np.interp(wanted, times, xy[:, axis]) for axis in (0, 1)])


def compute_speed(piece: np.ndarray) -> np.ndarray:
    """[N] speed [m/s]."""
    return np.asarray(np.linalg.norm(np.gradient(piece, STEP, axis=0), axis=1))


def match_pairs(
    ours: list[np.ndarray], real: list[np.ndarray], kind: str, count: int, rng: random.Random
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pairs of one of ours and a recorded one not used before, which does the same at that speed.

    Of each of ours in turn, that is the one nearest in mean speed.
    """
    rng.shuffle(ours)
    left = [(classify_piece(piece, kind), compute_speed(piece).mean(), piece) for piece in real]
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    for piece in ours:
        situation, mean = classify_piece(piece, kind), compute_speed(piece).mean()
        alike = [(abs(speed - mean), k) for k, (does, speed, _) in enumerate(left)
                 if does == situation and abs(speed - mean) < MOST_APART[kind]]  # fmt: skip
        if alike:
            pairs.append((piece, left.pop(min(alike)[1])[2]))
        if len(pairs) == count:
            break
    return pairs


def classify_piece(piece: np.ndarray, kind: str) -> str:
    """What it does over its 6 s."""
    velocity = np.gradient(piece, STEP, axis=0)
    return classify_motion(velocity, "vehicle" if kind == "vehicle" else "pedestrian")


def draw_sheets(
    pairs: list[tuple[np.ndarray, np.ndarray]], folder: Path, kind: str, rng: random.Random
) -> dict[str, str]:
    """The key: number of the pair -> letter of the recorded track."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    folder.mkdir(parents=True, exist_ok=True)
    key: dict[str, str] = {}
    for first in range(0, len(pairs), ON_A_SHEET):
        shown = pairs[first : first + ON_A_SHEET]
        figure, axes = pyplot.subplots(len(shown), 4, figsize=(15, 2.6 * len(shown)), squeeze=False)
        for row, (ours, real) in zip(axes, shown, strict=True):
            number = len(key) + 1
            recorded = rng.choice("AB")
            key[str(number)] = recorded
            order = (real, ours) if recorded == "A" else (ours, real)
            top = max(compute_speed(piece).max() for piece in order) * 1.1
            for letter, piece, (path, speed) in zip("AB", order, (row[:2], row[2:]), strict=True):
                draw_piece(path, speed, piece, top)
                path.set_title(f"pair {number}, {letter}: path [m]", fontsize=9)
                speed.set_title(f"pair {number}, {letter}: speed [m/s] over 6 s", fontsize=9)
        figure.tight_layout()
        figure.savefig(folder / f"{kind}-{first // ON_A_SHEET + 1}.png", dpi=80)
        pyplot.close(figure)
    return key


def draw_piece(path: Any, speed: Any, piece: np.ndarray, top: float) -> None:
    """The path from left to right, with a dot each second, and the speed over time."""
    along = piece[-1] - piece[0]
    c, s = along / np.linalg.norm(along)
    turned = (piece - piece[0]) @ np.array([[c, -s], [s, c]])
    path.plot(*turned.T, lw=1)
    path.plot(*turned[::10].T, ".", ms=4)
    middle = (turned[:, 1].min() + turned[:, 1].max()) / 2
    half = max(np.ptp(turned[:, 1]) / 2 * 1.1, LEAST_HALF_WIDTH)
    path.set_ylim(middle - half, middle + half)
    speed.plot(np.arange(len(piece)) * STEP, compute_speed(piece), lw=1)
    speed.set_ylim(0, top)


def main() -> None:
    """Draw the sheets, or score answers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ours", help="folder of scenes")
    parser.add_argument("--real", help="recorded tracks, as `evals realism` reads them")
    parser.add_argument("--scale", type=float, help="metres per pixel of tracks in pixels (VTP-TL)")
    parser.add_argument("--kind", choices=sorted(LEAST_MOVED), default="vehicle")
    parser.add_argument("--foreground", action="store_true", help="only agents of the request")
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--key", type=Path)
    parser.add_argument("--answers", type=Path)
    given = parser.parse_args()
    if given.key is not None:
        key, answers = (json.loads(f.read_text()) for f in (given.key, given.answers))
        right = sum(answers.get(number) == letter for number, letter in key.items())
        print(json.dumps(describe_rate(right, len(key))))
        return
    rng = random.Random(f"{given.seed} {given.real}")
    ours = list_pieces(read_source(given.ours), given.kind, foreground=given.foreground)
    real = list_pieces(read_source(given.real, scale=given.scale), given.kind, foreground=None)
    pairs = match_pairs(ours, real, given.kind, given.pairs, rng)
    key = draw_sheets(pairs, given.out, given.kind, rng)
    (given.out / "key.json").write_text(json.dumps(key, indent=1) + "\n", encoding="utf-8")
    print(f"{given.out}: {len(pairs)} pairs of {len(ours)} and {len(real)} tracks")


if __name__ == "__main__":
    main()
