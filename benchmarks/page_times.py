"""How long the page takes, in a headless Chromium: python benchmarks/page_times.py [--turns 12].

Needs the environment of `make page-tests`; SCENEWRIGHT_PYTHON names the interpreter that has
scenewright, CHROMIUM the browser. Prints the seconds from the command to the first page, and the
median and 95th percentile from a sentence, and from an edit, to the moving scene with its proof.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time

from playwright.sync_api import Page, TimeoutError, sync_playwright

SENTENCES = (
    "A car from the north yields to a pedestrian on the east crosswalk at 8 am",
    "A van is rear-ended by a car on the approach from the south",
    "A truck turning right yields to a pedestrian",
    "A car turning left narrowly misses an oncoming motorcycle at 5 pm",
    "A bus from the west follows a car",
    "A car hits a jaywalking pedestrian",
)
EDITS = ("make it night", "slow the car down", "add three cars", "no background traffic")
WAIT = 60_000


def take_turn(page: Page, words: str) -> float:
    """Seconds from the key to the proof in the player of the new version."""
    versions = page.locator("#tree .node").count()
    page.fill("#words", words)
    began = time.perf_counter()
    page.keyboard.press("Enter")
    try:
        page.wait_for_selector(f"#tree .node >> nth={versions}", state="attached", timeout=WAIT)
    except TimeoutError:
        sys.exit(f"{words!r} made no version: {page.locator('#log .answer').last.inner_text()}")
    page.frame_locator("#players iframe").locator("#verdict").wait_for(timeout=WAIT)
    return time.perf_counter() - began


def describe(name: str, seconds: list[float]) -> None:
    """One line: how many, median, 95th percentile."""
    high = sorted(seconds)[max(0, round(0.95 * len(seconds)) - 1)]
    print(f"{name}: n {len(seconds)}, median {statistics.median(seconds):.2f} s, 95 % {high:.2f} s")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=12)
    turns = parser.parse_args().turns
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        program = os.environ.get("SCENEWRIGHT_PYTHON", sys.executable)
        chromium = os.environ.get("CHROMIUM", "/usr/bin/chromium")
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        began = time.perf_counter()
        server = subprocess.Popen(
            [program, "-m", "scenewright", "serve", "--port", "0"],
            stderr=subprocess.PIPE, text=True, env={**os.environ, "SCENEWRIGHT_DATA": folder},
        )  # fmt: skip
        assert server.stderr is not None
        found = re.search(r"open (\S+)", server.stderr.readline())
        assert found is not None
        page = browser.new_page()
        page.goto(found[1], timeout=WAIT)
        page.wait_for_selector("#examples button", timeout=WAIT)
        print(f"first page: {time.perf_counter() - began:.2f} s after the command")
        take_turn(page, SENTENCES[0])  # warm
        made: list[float] = []
        edited: list[float] = []
        for turn in range(turns):
            page.click("#new")
            made.append(take_turn(page, SENTENCES[turn % len(SENTENCES)]))
            edited.append(take_turn(page, EDITS[turn % len(EDITS)]))
        describe("a sentence", made)
        describe("an edit", edited)
        print(f"load average {os.getloadavg()[0]:.1f}")
        server.terminate()
        server.wait(600)


if __name__ == "__main__":
    main()
