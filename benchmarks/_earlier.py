"""An earlier commit's sources beside today's, to measure both in one run."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parent.parent


@contextmanager
def check_out(commit: str) -> Iterator[dict[str, dict[str, str]]]:
    """Environments in which Python imports an earlier commit's package, and today's, by name."""
    git = ["git", "-C", str(ROOT), "worktree"]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "earlier"
        # A second command reads what the first has translated, as it does for who uses it.
        kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        kept |= {"PYTHONPYCACHEPREFIX": str(Path(folder) / "bytecode"), "OMP_NUM_THREADS": "1"}
        subprocess.run([*git, "add", "--quiet", "--detach", str(place), commit], check=True)
        try:
            yield {
                name: {**kept, "PYTHONPATH": str(root / "src")}
                for name, root in ((commit, place), ("now", ROOT))
            }
        finally:
            subprocess.run([*git, "remove", "--force", str(place)], check=True)
