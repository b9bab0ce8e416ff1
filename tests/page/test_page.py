"""The page in a real browser, with a server of its own: `make page-tests`.

Not part of the quick suite: it needs Chromium, playwright and sockets. SCENEWRIGHT_PYTHON names the
interpreter that has scenewright, CHROMIUM the browser.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("playwright")
from playwright.sync_api import Browser, Page, sync_playwright

SIZES = [(1500, 950), (800, 1100)]
YIELD = "A car from the north yields to a pedestrian on the east crosswalk at 8 am"
HOSTILE = "<img src=x onerror=\"document.title='broken'\"><script>document.title='broken'</script>"
WAIT = 180_000
"""Longest wait for a turn [ms]; other work may share the machine."""


class Served:
    """A server in a process of its own, on any free port."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.start()

    def start(self) -> None:
        program = os.environ.get("SCENEWRIGHT_PYTHON", sys.executable)
        self.process = subprocess.Popen(
            [program, "-m", "scenewright", "serve", "--port", "0", "--seed", "4"],
            stderr=subprocess.PIPE, text=True,
            env={**os.environ, "SCENEWRIGHT_DATA": str(self.folder)},
        )  # fmt: skip
        assert self.process.stderr is not None
        found = re.search(r"open (\S+)", self.process.stderr.readline())
        assert found is not None
        self.address = found[1]

    def end(self, how: signal.Signals = signal.SIGINT) -> None:
        self.process.send_signal(how)
        self.process.communicate(timeout=60)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    server = Served(tmp_path_factory.mktemp("data"))
    yield server
    if server.process.poll() is None:
        server.end()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as driver:
        program = os.environ.get("CHROMIUM", "/usr/bin/chromium")
        yield driver.chromium.launch(executable_path=program, args=["--no-sandbox"])


@pytest.fixture(params=SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def page(request: pytest.FixtureRequest, browser: Browser, served: Served) -> Iterator[Page]:
    """The page at one of two sizes; it must ask no other host and raise nothing."""
    width, height = request.param
    opened = browser.new_page(viewport={"width": width, "height": height})
    asked: list[str] = []
    faults: list[str] = []
    opened.on("request", lambda each: asked.append(each.url))
    opened.on("pageerror", lambda each: faults.append(str(each)))
    opened.goto(served.address)
    opened.wait_for_selector("#places img")
    yield opened
    hosts = {url.split("/")[2] for url in asked if url.startswith("http")}
    opened.close()
    assert hosts <= {served.address.split("/")[2]}
    assert faults == []


def wait_until_free(page: Page) -> None:
    page.wait_for_selector("#send:not([disabled])", timeout=WAIT)


def say(page: Page, words: str) -> str:
    page.fill("#words", words)
    page.keyboard.press("Enter")
    wait_until_free(page)
    return page.inner_text("#log .answer:last-child")


def keep_picture(page: Page, name: str) -> None:
    if folder := os.environ.get("SCREENSHOTS"):
        size = page.viewport_size or {"width": 0}
        page.screenshot(path=str(Path(folder) / f"{name}-{size['width']}.png"))


def test_a_conversation_with_changes_by_hand(page: Page) -> None:
    assert "verified" in say(page, YIELD)
    keep_picture(page, "scene")
    assert "refused" in say(page, "remove the truck")
    page.click("#by-hand")
    page.wait_for_selector("#hand table")
    page.select_option('[aria-label="vehicle-1: way"]', label="south to east (right)")
    page.wait_for_selector("#log .answer >> nth=2", timeout=WAIT)
    wait_until_free(page)
    assert "south to east" in page.inner_text("#log .answer:last-child")
    page.select_option("#against", "1")
    page.check("#overlay")
    page.wait_for_selector("#differences li")
    page.click("#making")
    page.wait_for_selector("svg.run")
    keep_picture(page, "by-hand")
    page.click("#undo")
    wait_until_free(page)
    assert "version 1" in page.inner_text("#log .answer:last-child")


def test_hostile_words_are_text(page: Page) -> None:
    say(page, YIELD)
    say(page, HOSTILE)
    assert page.title() == "scenewright"
    assert HOSTILE in page.inner_text("#log")


def test_a_batch_is_watched_filtered_and_opened(page: Page, tmp_path: Path) -> None:
    rows = [{"id": "<b>one</b>", "text": YIELD}, {"id": "two", "text": "a pig flies"}]
    file = tmp_path / "rows.jsonl"
    file.write_text("\n".join(map(json.dumps, rows)))
    page.click("#tab-batch")
    page.set_input_files("#batch-file", str(file))
    page.wait_for_selector("#batch-rows tbody tr:nth-child(2)", timeout=WAIT)
    page.select_option("#batch-event", "yielding")
    assert page.locator("#batch-rows tbody tr").count() == 1
    page.click("#batch-rows button")
    page.wait_for_selector("#batch-player iframe")
    keep_picture(page, "batch")


def test_an_event_draws_what_was_measured(page: Page) -> None:
    say(page, YIELD)
    frame = page.frame_locator("#players iframe")
    frame.locator("#events button").first.click()
    assert frame.locator("#events button").first.get_attribute("aria-current") == "true"
    keep_picture(page, "event")


def test_a_reload_in_the_middle_of_a_turn_and_two_tabs(page: Page, served: Served) -> None:
    say(page, YIELD)
    page.fill("#words", "now have it be a collision")
    page.keyboard.press("Enter")
    time.sleep(0.1)
    page.reload()
    wait_until_free(page)
    page.wait_for_selector("#tree .node >> nth=1", state="attached", timeout=WAIT)
    other = page.context.new_page()
    other.goto(page.url)
    other.wait_for_selector("#tree .node >> nth=1", state="attached")
    assert "version" in say(other, "undo")
    other.close()


def test_a_network_that_is_cut_and_a_server_that_is_killed(page: Page, served: Served) -> None:
    page.context.set_offline(True)
    assert "does not answer" in say(page, YIELD)
    page.context.set_offline(False)
    assert "verified" in say(page, YIELD)
    served.end(signal.SIGKILL)
    assert "does not answer" in say(page, "make it night")
    served.start()


def test_no_serious_fault_of_accessibility(page: Page) -> None:
    from axe_playwright_python.sync_playwright import Axe

    say(page, YIELD)
    for tab in ("#tab-talking", "#tab-batch"):
        page.click(tab)
        found: list[Any] = Axe().run(page).response["violations"]
        bad = [each["id"] for each in found if each["impact"] in ("serious", "critical")]
        assert bad == [], json.dumps(found)[:3000]
