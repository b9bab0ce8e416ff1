"""`scenewright check` and `warm`: whether scenes can be made here; the innermost loops compiled."""

from __future__ import annotations

import multiprocessing
import platform
import signal
import time
from typing import Any

from scenewright.cli.console import ProgressCallback, Result, say_if_new
from scenewright.cli.errors import NOT_VERIFIED
from scenewright.cli.options import option

LOOPS = 190
"""That both processes compile, for the progress."""


def warm(log: ProgressCallback) -> Result:
    """Compile the innermost loops, once after an installation, so that no scene waits for it."""
    from scenewright.compiled import watch_compiling
    from scenewright.graph.run import synthesize

    begin, context = time.monotonic(), multiprocessing.get_context("spawn")
    elsewhere = context.Value("i")
    helper = context.Process(target=compile_last_stages, args=(elsewhere,), daemon=True)

    def tell(own: int) -> None:
        if own % 10 == 0:
            spent, count = time.monotonic() - begin, own + elsewhere.value
            left = max(LOOPS - count, 0) * spent / count
            log("compiling", f"{count} of about {LOOPS} loops, about {left:.0f} s left")

    with watch_compiling(tell) as names:
        helper.start()
        synthesize("A car hits a pedestrian", seed=0)
        helper.join()
    if helper.exitcode:
        raise RuntimeError(f"the second process of warm ended with code {helper.exitcode}")
    seconds, count = time.monotonic() - begin, len(names) + elsewhere.value
    done = f"{count} loops compiled in {seconds:.0f} s, kept on disk\n"
    text = done if count else "nothing to compile: all loops are kept on disk\n"
    return Result({"compiled": count, "seconds": round(seconds, 1)}, text)


def compile_last_stages(compiled: Any) -> None:
    """Compile what the refiner and the checker run, half of all, on tracks that are at hand.

    Args:
        compiled: shared integer, how many loops have been compiled here.
    """
    import numpy as np

    from scenewright.compiled import watch_compiling
    from scenewright.graph.arguments import DEFAULT_INTERSECTION
    from scenewright.graph.verify import examine_tracks
    from scenewright.tools.track_io.external_tracks import read_tracks
    from scenewright.tools.trajnet_refiner.bundled import find_refiner
    from scenewright.tools.trajnet_refiner.rollout import Waypoints, run_rollout

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its parent ends it
    # A collision, a near miss, and one who follows.
    agents = (
        ("car", -40, -2, 1, 0), ("car", -55, -2, 1, 0), ("car", 2, -30, 0, 0.6),
        ("pedestrian", 0, -12, 0, 0.12),
    )  # fmt: skip
    rows = [
        f"{k / 10},{name},{kind},{x + k * dx},{y + k * dy}"
        for name, (kind, x, y, dx, dy) in enumerate(agents)
        for k in range(100)
    ]
    with watch_compiling(lambda count: setattr(compiled, "value", count)):
        if (refiner := find_refiner(DEFAULT_INTERSECTION)) is not None:
            known, goals = np.full((2, 12, 2), np.nan), np.full((2, 1), 11.0)
            known[:, :9] = 0.0
            waypoints, both = Waypoints(np.zeros((2, 1, 2)), goals), np.array([0, 1])
            run_rollout(refiner.net, known, classes=both, waypoints=waypoints, keep=2, lead=3)
        tracks = read_tracks("\n".join(["t,id,class,x,y", *rows]).encode(), name="warm.csv")
        examine_tracks(tracks, intersection=DEFAULT_INTERSECTION)


_TEXT = "A car yields to a pedestrian"


def check_installation(seed: int = option(0, "Of the scene that is made.")) -> Result:
    """Make a scene, verify it, and say so in one line; nothing is written."""
    from scenewright import __version__
    from scenewright.graph.run import synthesize
    from scenewright.graph.verify import verify

    say_if_new()
    start = time.perf_counter()
    scene = synthesize(_TEXT, seed=seed)
    verdict = verify(scene, strict=True).verdict
    facts = {
        "scenewright": __version__,
        "python": platform.python_version(),
        "refiner": scene.provenance["refinement"]["refiner"],
        "seconds": round(time.perf_counter() - start, 1),
        "verdict": verdict,
    }
    text = ", ".join(f"{name} {value}" for name, value in facts.items()) + "\n"
    good = verdict == "verified"
    return Result({"ok": good, **facts}, text, code=0 if good else NOT_VERIFIED)
