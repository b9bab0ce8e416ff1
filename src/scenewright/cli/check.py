"""`scenewright check`: whether scenes can be made here, in one line."""

from __future__ import annotations

import platform
import time

import typer

from scenewright.cli.common_options import Json, option
from scenewright.cli.console import say_if_new, write_result
from scenewright.cli.errors import NOT_VERIFIED

_TEXT = "A car yields to a pedestrian"


def check_installation(
    as_json: Json = False,
    seed: int = option(0, "Of the scene that is made."),
) -> None:
    """Make a scene, verify it, and say so in one line; nothing is written."""
    from scenewright import __version__
    from scenewright.graph.run import synthesize, verify

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
    write_result({"ok": verdict == "verified", **facts}, text, as_json=as_json)
    if verdict != "verified":
        raise typer.Exit(NOT_VERIFIED)
