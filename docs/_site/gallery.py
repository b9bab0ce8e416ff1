"""Makes the gallery: one scene for each instruction below, its picture and `docs/gallery.md`.

python docs/_site/gallery.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).parent.parent
IMAGES = DOCS / "images" / "gallery"
INSTRUCTIONS = {
    "yield": "A car turning left yields to a pedestrian on the crosswalk at 8 am",
    "strike": "A right-turning truck hits a pedestrian on the crosswalk at dusk",
    "near-miss": "A taxi narrowly misses a jaywalker at noon",
    "red-light": "A van from the east runs a red light and T-bones a northbound car",
    "rear-end": "A bus rear-ends a car that waits at the light in the evening rush",
    "left-turn": "A car turning left collides with an oncoming motorcycle at 5 pm",
    "follow": "An SUV follows a bus from the south through the intersection at noon",
    "chain": "A car yields to a pedestrian and is then rear-ended by a van",
    "head-on": "Two cars nearly collide head-on at night",
    "normal": "Ordinary traffic during the morning rush, nothing happens",
}
WIDTH = 900


def make_entry(name: str, instruction: str) -> str:
    """One section of the page; writes its picture beside it."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "scenewright", "make", instruction, "--seed", "1"]
        made = subprocess.run(
            [*command, "--out", f"{folder}/scene"],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        shrink_picture(Path(folder, "scene", "scene.png"), IMAGES / f"{name}.png")
    lines = (made.stdout + made.stderr).splitlines()
    summary = "\n".join(lines[lines.index("verified") : -1])
    picture = f"![{instruction}](images/gallery/{name}.png)"
    return f"## {instruction}\n\n{picture}\n\n```text\n{summary}\n```\n"


def shrink_picture(source: Path, target: Path) -> None:
    """A picture small enough for a page."""
    with Image.open(source) as picture:
        picture.thumbnail((WIDTH, WIDTH))
        picture.convert("P", palette=Image.Palette.ADAPTIVE).save(target, optimize=True)


def main() -> None:
    """Writes the page and its pictures."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    entries = [make_entry(*item) for item in INSTRUCTIONS.items()]
    head = "# Gallery\n\nEvery scene is verified. `python docs/_site/gallery.py` makes this page.\n"
    (DOCS / "gallery.md").write_text("\n".join([head, *entries]), encoding="utf-8")


if __name__ == "__main__":
    main()
