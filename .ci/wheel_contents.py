"""Fails unless the installed package is the wheel's and the wheel holds every data file.

Usage: python .ci/wheel_contents.py WHEEL, from the root of a clone.
"""

from __future__ import annotations

import subprocess
import sys
import zipfile
from fnmatch import fnmatch
from pathlib import Path

NEEDED = (
    "scenewright/py.typed",
    "scenewright/intersections/*/map.json",
    "scenewright/intersections/*/priors.npz",
    "scenewright/scene/relations/*.toml",
    "scenewright/scene/kinds/*/*.toml",
    "scenewright/scene/catalogue/*.yaml",
    "scenewright/dataset/tables/columns.toml",
    "scenewright/driving/ego_benchmark.json",
    "scenewright/tools/account/words.toml",
    "scenewright/tools/dsl_validator/constraints.lark",
    "scenewright/backends/builtin/vocabulary.toml",
    "scenewright/backends/builtin/reader/reader.safetensors",
    "scenewright/backends/builtin/reader/tokenizer.json",
    "scenewright/backends/builtin/training/instructions/*.txt",
    "scenewright/nodes/*/prompt.md",
    "scenewright/viz/player/player.*",
    "scenewright/cli/page/assets/app.*",
    "scenewright-*.dist-info/licenses/LICENSE",
)


def missing_patterns(names: list[str]) -> list[str]:
    """Kinds of data file of which the wheel holds none."""
    return [pattern for pattern in NEEDED if not any(fnmatch(name, pattern) for name in names)]


def missing_sources(names: list[str]) -> list[str]:
    """Files under version control in the package folder that the wheel lacks."""
    listing = subprocess.run(
        ["git", "ls-files", "src/scenewright"], check=True, capture_output=True, text=True
    )
    tracked = [line.removeprefix("src/") for line in listing.stdout.splitlines()]
    return sorted(set(tracked) - set(names))


def installed_elsewhere() -> list[str]:
    """The folder of the imported package, if that is not the environment's own."""
    import scenewright

    folder = Path(scenewright.__file__).resolve()
    return [] if folder.is_relative_to(Path(sys.prefix).resolve()) else [str(folder)]


def main(wheel: str) -> int:
    """The exit code: 0 if the wheel is whole."""
    names = zipfile.ZipFile(wheel).namelist()
    faults = {
        "no file like": missing_patterns(names),
        "not in the wheel": missing_sources(names),
        "imported from": installed_elsewhere(),
    }
    for words, items in faults.items():
        for item in items:
            print(f"{words}: {item}", file=sys.stderr)
    print(f"{len(names)} files in {Path(wheel).name}")
    return 1 if any(faults.values()) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
