"""How well a pool predicts where vehicles drive at a place of which it has seen nothing.

    python benchmarks/pool_transfer.py NAME TRACKS --pool TRACKS [--pool-scale 0.065] ...

NAME is an imported intersection, TRACKS its recorded ones. The likelihood is p_wp's of the offsets
to the side that were seen, in nats per waypoint, vehicles only, the line of each track known. The
priors are fitted on none of them: only the pool differs. It is the shipped intersection's, then the
same with the lanes of --pool.
"""

from __future__ import annotations

import argparse

import numpy as np

from scenewright.cli.custom_intersections import _fit_elsewhere
from scenewright.tools.fitting.custom_bundle import open_custom_bundle
from scenewright.tools.fitting.fit_tracks import (
    FrameChange,
    LaneOffsets,
    WaypointFit,
    compute_cross_validated_nll,
    fit_tracks,
)
from scenewright.tools.track_io.track_files import read_track_files


def compute_interval(
    one: np.ndarray, other: np.ndarray, rng: np.random.Generator
) -> tuple[float, float]:
    """95 % of the difference of means, drawn again over tracks."""
    picks = rng.integers(len(one), size=(2000, len(one)))
    return tuple(np.quantile((other - one)[picks].mean(axis=1), [0.025, 0.975]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("tracks", nargs="+")
    parser.add_argument("--pool", nargs="+", required=True)
    parser.add_argument("--pool-scale", type=float, nargs="*", default=[None])
    options = parser.parse_args()
    own = open_custom_bundle(options.name)
    files = read_track_files(options.tracks)
    fitted = fit_tracks(own.intersection_map, own.route_lines, files, FrameChange(own.origin))
    matches = [m for m in fitted.matches if m.route.startswith("vehicle:")]

    def evaluate(lanes: LaneOffsets | None) -> list[float]:
        pool = WaypointFit(own.intersection_map, own.route_lines, (), lanes).pools
        return compute_cross_validated_nll(
            own.intersection_map, own.route_lines, matches, pool=pool
        )

    shipped = evaluate(None)
    print(f"{options.name}, {len(shipped)} tracks: shipped pool {np.mean(shipped):.3f}")
    for scale in options.pool_scale:
        lanes, told = _fit_elsewhere(options.pool, scale)
        found = evaluate(lanes)
        low, high = compute_interval(np.array(shipped), np.array(found), np.random.default_rng(0))
        print(f"  {'; '.join(told)}")
        print(f"  {np.mean(found):.3f}, against the shipped {low:+.3f} to {high:+.3f}")


if __name__ == "__main__":
    main()
