"""Makes the pictures of the page in `docs/images`, with a server of its own and Chromium.

Run by an interpreter that has playwright (tests/page/requirements.txt); SCENEWRIGHT_PYTHON names
the one that has scenewright, CHROMIUM the browser:

python docs/_site/page_pictures.py
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

IMAGES = Path(__file__).parent.parent / "images"
YIELD = "A taxi from the north yields to an old lady on the east crosswalk at 8 am"
MISS = "A car from the north turning left narrowly misses a jogger on the east crosswalk at 8 am"
WAIT = 240_000
"""Longest wait for a turn [ms]."""


def open_page(browser: Browser, address: str, *, width: int = 1500, height: int = 950) -> Page:
    """A fresh page of the server, or of a file."""
    context = browser.new_context(viewport={"width": width, "height": height})
    context.set_default_timeout(WAIT)
    page = context.new_page()
    page.goto(address)
    return page


def say(page: Page, words: str) -> None:
    """Send words and wait for the scene."""
    page.fill("#words", words)
    page.keyboard.press("Enter")
    page.wait_for_selector("#send:not([disabled])", timeout=WAIT)
    stop_at_event(page)


def stop_at_event(page: Page) -> None:
    """Each player on the page stands still at its first event."""
    for k in range(page.locator("#players iframe").count()):
        frame = page.frame_locator("#players iframe").nth(k)
        if frame.locator("#play").get_attribute("aria-label") == "Pause":
            frame.locator("#play").click()
        event = frame.locator("#events button").first
        if event.get_attribute("aria-current") != "true":
            event.click()


def take_pictures(browser: Browser, address: str, rows: Path) -> None:
    """All pictures of the served page."""
    page = open_page(browser, address)
    page.wait_for_selector("#places img")
    say(page, YIELD)
    page.screenshot(path=str(IMAGES / "serve.png"))
    page.click("#theme")
    page.screenshot(path=str(IMAGES / "page-dark.png"))
    page.click("#theme")
    page.set_viewport_size({"width": 1200, "height": 760})
    stop_at_event(page)
    page.screenshot(path=str(IMAGES / "page-evidence.png"))
    page.set_viewport_size({"width": 1500, "height": 950})
    say(page, "now have it be a collision")
    page.select_option("#against", "1")
    page.wait_for_selector("#differences li")
    stop_at_event(page)
    page.screenshot(path=str(IMAGES / "page-compare.png"))
    page.set_viewport_size({"width": 1200, "height": 760})
    page.click("#tab-batch")
    page.set_input_files("#batch-file", str(rows))
    page.wait_for_selector("#batch-rows tbody tr:nth-child(3)", timeout=WAIT)
    page.click("#batch-rows button")
    player = page.frame_locator("#batch-player iframe")
    player.locator("#events button").first.click()
    page.screenshot(path=str(IMAGES / "page-batch.png"))


def main() -> None:
    """Serve, take every picture, and draw the page to share."""
    program = os.environ.get("SCENEWRIGHT_PYTHON", sys.executable)
    chromium = os.environ.get("CHROMIUM", "/usr/bin/chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        rows = Path(folder) / "rows.jsonl"
        texts = YIELD, "A van rear-ends a bus at noon", "A cyclist hits a jaywalker"
        lines = [json.dumps({"id": f"row-{k}", "text": text}) for k, text in enumerate(texts)]
        rows.write_text("\n".join(lines))
        make = [program, "-m", "scenewright", "make", MISS, "--seed", "3", "--html"]
        subprocess.run([*make, "--out", f"{folder}/share"], check=True, capture_output=True)
        shared = next(Path(folder, "share").glob("*.html"))
        server = subprocess.Popen(
            [program, "-m", "scenewright", "serve", "--port", "0", "--seed", "4"],
            stderr=subprocess.PIPE, text=True, env={**os.environ, "SCENEWRIGHT_DATA": folder},
        )  # fmt: skip
        try:
            found = re.search(r"open (\S+)", server.stderr.readline() if server.stderr else "")
            if found is None:
                sys.exit("the server prints no address")
            browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            take_pictures(browser, found[1], rows)
            page = open_page(browser, shared.as_uri(), width=1400, height=1010)
            page.locator("#play").click()
            page.locator("#events button").first.click()
            page.screenshot(path=str(IMAGES / "page.png"))
            browser.close()
        finally:
            server.terminate()
            server.wait(60)


if __name__ == "__main__":
    main()
