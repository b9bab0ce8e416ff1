"""`scenewright check`: whether scenes can be made here, in one line."""

from __future__ import annotations

import platform
import time
from typing import Annotated

import typer

from scenewright.cli.common_options import Json
from scenewright.cli.console import say_if_new, write_json, write_stdout
from scenewright.cli.errors import NOT_VERIFIED

_TEXT = "A car yields to a pedestrian"


def check_installation(
    as_json: Json = False,
    seed: Annotated[int, typer.Option(help="Of the scene that is made.")] = 0,
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
    if as_json:
        write_json({"ok": verdict == "verified", **facts})
    else:
        write_stdout(", ".join(f"{name} {value}" for name, value in facts.items()) + "\n")
    if verdict != "verified":
        raise typer.Exit(NOT_VERIFIED)
