"""Another implementation, asked in a process and an environment of its own.

A peer is a script in `peers/` that reads JSON and writes JSON. It runs with the interpreter
`<folder>/<peer>/bin/python`, where the folder is named by the environment variable
SCENEWRIGHT_CROSSCHECK or else lies in the environment of the tests, as `make crosscheck` lays it;
failing that with the interpreter of the tests, if the peer's package is installed there.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import ledger
import pytest

FOLDER = "SCENEWRIGHT_CROSSCHECK"
MODULES = {
    "omega-prime": "omega_prime",
    "python-fcl": "fcl",
    "eclipse-sumo": "sumo",
    "scenario-gym": "scenario_gym",
    "commonroad-crime": "commonroad_crime",
}
"""What each peer imports, by the name of its package."""


def ask(peer: str, question: dict[str, Any]) -> dict[str, Any]:
    """The peer's answer; the test is skipped where the peer is not installed."""
    script = Path(__file__).parent / "peers" / f"ask_{peer.replace('-', '_')}.py"
    process = subprocess.run(
        [str(_interpreter(peer)), "-W", "ignore", str(script)],
        input=json.dumps(question), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert process.returncode == 0, f"{peer}: {process.stderr[-2000:]}"
    answer: dict[str, Any] = json.loads(process.stdout)
    ledger.VERSIONS[peer] = answer["version"]
    return answer


def _interpreter(peer: str) -> Path:
    folder = Path(os.environ.get(FOLDER, Path(sys.prefix) / "crosscheck"))
    own = folder / peer / "bin" / "python"
    if own.exists():
        return own
    if importlib.util.find_spec(MODULES[peer]) is not None:
        return Path(sys.executable)
    pytest.skip(f"{peer} is not installed; `make crosscheck` installs it")
