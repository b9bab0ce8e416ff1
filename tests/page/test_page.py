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
from playwright.sync_api import Browser, Page, expect, sync_playwright

SIZES = [(1500, 950), (800, 1100)]
YIELD = "A car from the north yields to a pedestrian on the east crosswalk at 8 am"
HOSTILE = "<img src=x onerror=\"document.title='broken'\"><script>document.title='broken'</script>"
expect.set_options(timeout=60_000)
WAIT = 180_000
"""Longest wait for a turn [ms]; other work may share the machine."""


class Served:
    """A server in a process of its own, on any free port."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        program = os.environ.get("SCENEWRIGHT_PYTHON", sys.executable)
        made = str(folder / "first")  # what is compiled once per installation is compiled now
        subprocess.run(
            [program, "-m", "scenewright", "make", YIELD, "--seed", "4", "--out", made], check=False
        )
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
    context = browser.new_context(viewport={"width": width, "height": height})
    context.set_default_timeout(WAIT)
    opened, own = context.new_page(), served.address.split("/")[2]
    asked: list[str] = []
    faults: list[str] = []
    opened.on("request", lambda each: asked.append(each.url))
    opened.on("pageerror", lambda each: faults.append(str(each)))
    opened.goto(served.address)
    opened.wait_for_selector("#places img")
    yield opened
    hosts = {url.split("/")[2] for url in asked if url.startswith("http")}
    context.close()
    assert hosts == {own}
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
    assert "refused" in say(page, "remove the tram")
    page.click("#by-hand")
    page.wait_for_selector("#hand table")
    page.select_option('[aria-label="the car: way"]', label="south to east (right)")
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


def test_words_and_form_follow_one_another(page: Page) -> None:
    page.fill("#words", YIELD)
    page.click("#as-form")
    place = page.locator('[data-path="agents[1].crosswalk"]')
    expect(place).to_have_value("east")
    for n, (path, value, words) in enumerate((
        ("agents[0].subtype", "bus", "A bus comes from the north"),
        ("agents[1].crosswalk", "west", "on the west crosswalk"),
        ("relations[0].type", "near_miss", "narrowly misses"),
        ("agents[0].entry", "south", "comes from the south"),
    )):  # fmt: skip
        page.select_option(f'[data-path="{path}"]', value)
        expect(page.locator("#words")).to_have_value(re.compile(words))
        page.fill("#words", YIELD.replace("8 am", f"{n + 1} pm"))
        expect(page.locator('[data-path="context.time_of_day"]')).to_have_value(f"{n + 13}:00")
    page.select_option('[aria-label="Set more of agents 0"]', "movement")
    page.select_option('[data-path="agents[0].movement"]', "left")
    expect(page.locator("#words")).to_have_value(re.compile("turns left"))
    page.click('[aria-label="Add to: Figures"]')
    page.fill('[data-path="measures[0].value"]', "fast")
    page.keyboard.press("Tab")
    expect(page.locator("#plan-said")).to_contain_text("a number in m/s")
    page.fill('[data-path="measures[0].value"]', "25 km/h")
    page.keyboard.press("Tab")
    expect(page.locator("#words")).to_have_value(re.compile(r"drives at 25 km/h"))
    keep_picture(page, "form")
    page.click("#send")
    page.wait_for_selector("#log .answer", timeout=WAIT)
    wait_until_free(page)
    assert "version 1: verified" in page.inner_text("#log .answer")
    expect(page.locator('[data-path="agents[0].subtype"]')).to_have_value("car")


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
    page.frame_locator("#batch-player iframe").locator("#events button").first.wait_for()
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


def test_the_player_plays_steps_and_shows_what_the_words_became(page: Page) -> None:
    say(page, YIELD)
    frame = page.frame_locator("#players iframe")
    clock = frame.locator("#clock")
    frame.locator("#scrub").fill("2")
    before = clock.inner_text()
    frame.locator("#forward").click()
    assert clock.inner_text() != before
    frame.locator("#back").click()
    assert clock.inner_text() == before
    frame.locator("#rate").select_option("4")
    frame.locator("#play").click()
    expect(clock).not_to_have_text(before)
    frame.locator("#play").click()
    frame.locator("#map").press("Home")
    assert clock.inner_text().startswith("0.0")
    frame.locator(".lane .track").first.click()
    assert not clock.inner_text().startswith("0.0")
    assert frame.locator("#instruction mark").count() >= 4
    assert frame.locator("#account tbody tr").count() >= 4
    charts = frame.locator(".chart canvas")
    assert charts.count() == 4
    charts.first.hover()
    assert " at " in frame.locator(".chart p").first.inner_text()


def test_a_scene_plays_at_once_at_night_and_an_agent_is_followed(page: Page) -> None:
    say(page, "A taxi yields to an old lady on the east crosswalk at 11 pm")
    frame = page.frame_locator("#players iframe")
    expect(frame.locator("#play")).to_have_attribute("aria-label", "Pause")
    expect(frame.locator(".picture")).to_have_class(re.compile("night"))
    assert "the taxi yields to the old lady" in frame.locator("#events").inner_text()
    frame.locator("#next-event").click()
    frame.locator("#play").click()
    lane = frame.locator(".lane button.label", has_text="the taxi")
    lane.click()
    expect(lane).to_have_attribute("aria-pressed", "true")
    keep_picture(page, "followed")
    frame.locator("#unfollow").click()
    expect(frame.locator("#unfollow")).to_be_hidden()
    player = page.frames[-1]
    spot = player.evaluate(
        """() => { const taxi = data.agents.find((each) => each.called === "the taxi"),
          at = (seek(data.mainTime), sampleAgent(taxi, data.mainTime));
          return toPixels([at.x, at.y]); }"""
    )
    frame.locator("#map").hover(position={"x": spot[0], "y": spot[1]})
    keep_picture(page, "hovered")
    frame.locator("#map").click(position={"x": spot[0], "y": spot[1]})
    expect(frame.locator("#unfollow")).to_have_text(re.compile("Following the taxi"))


def test_no_two_labels_overlap_at_any_time(page: Page) -> None:
    say(page, "A car hits a van and an old lady is nearly hit by a bus at 11 pm")
    page.frame_locator("#players iframe").locator("#play").click()
    worst = page.frames[-1].evaluate(
        """() => {
          const put = putLabel, times = [...new Set(data.events.map((each) => each.time))];
          let boxes = [], found = [];
          putLabel = (text, box, colour) => { boxes.push([text, box]); put(text, box, colour); };
          for (let time = 0; time <= END; time += 0.5) for (const event of [null, 0]) {
            boxes = []; state.event = event; seek(time);
            boxes.forEach(([a, p], i) => boxes.slice(i + 1).forEach(([b, q]) => {
              const apart = p[0] >= q[2] || q[0] >= p[2] || p[1] >= q[3] || q[1] >= p[3];
              if (!apart) found.push([time, a, b]);
            }));
          }
          return found;
        }"""
    )
    assert worst == []


def test_the_two_ways_to_go_on_and_words_that_leave_out_what_cannot_be(page: Page) -> None:
    assert page.inner_text("#send") == "Make the scene"
    assert page.is_hidden("#anew")
    words = "A van yields to a juggling pedestrian at 5 am"
    assert "refused" in say(page, words)
    keep_picture(page, "choices")
    page.click("#choices button:has-text('Leave it out')")
    wait_until_free(page)
    assert "partly" in page.inner_text("#log .answer:last-child")
    assert page.inner_text("#send") == "Change this scene"
    before = page.inner_text("#log")
    page.reload()
    page.wait_for_selector("#players iframe")
    wait_until_free(page)
    assert page.inner_text("#log") == before
    page.fill("#words", YIELD)
    page.click("#anew")
    wait_until_free(page)
    assert YIELD in page.frame_locator("#players iframe").locator("#instruction").inner_text()
    assert not re.search(r"\b(?:vehicle|pedestrian)-1\b|_|\brad\b", page.inner_text("#log"))


def test_words_are_completed_and_a_version_is_saved(page: Page) -> None:
    page.locator("#words").press_sequentially("A tax")
    page.click("#completions button:text-is('taxi')")
    assert page.input_value("#words") == "A taxi "
    page.locator("#words").press_sequentially("is hi")
    page.click("#completions button:has-text('is hit by')")
    assert page.input_value("#words") == "A taxi is hit by "
    page.click("#examples button >> nth=0")
    wait_until_free(page)
    for choice, ending in (("scene.png", ".png"), ("export.zip:csv", "-csv.zip")):
        with page.expect_download() as saved:
            page.select_option("#save", choice)
        assert saved.value.suggested_filename.endswith(ending)
    page.select_option("#save", "export.zip:csv")
    page.click("#branch")
    page.fill("#name", HOSTILE[:60])
    page.click("#ask button[value=ok]")
    expect(page.locator("#log .answer").last).to_contain_text(HOSTILE[:60])


def test_dark_is_dark_in_the_player_too(page: Page) -> None:
    say(page, YIELD)
    page.click("#theme")
    player = page.frame_locator("#players iframe").locator("html")
    expect(player).to_have_class(re.compile("dark"))
    keep_picture(page, "dark")
    page.click("#theme")
    expect(player).not_to_have_class(re.compile("dark"))


def test_versions_branch_and_stand_side_by_side(page: Page) -> None:
    say(page, YIELD)
    say(page, "now have it be a collision")
    page.click("#undo")
    wait_until_free(page)
    page.click("#redo")
    wait_until_free(page)
    page.click("#branch")
    page.fill("#name", "other-way")
    page.click("#ask button[value=ok]")
    expect(page.locator("#log .answer").last).to_contain_text("other-way")
    page.select_option("#against", "1")
    page.wait_for_selector("#differences li")
    assert page.locator("#players iframe").count() == 2
    keep_picture(page, "side-by-side")
    page.click("#tree .node >> nth=0")
    assert page.input_value("#version") == "1"


def test_a_bar_of_the_timeline_is_dragged(page: Page) -> None:
    say(page, YIELD)
    page.click("#by-hand")
    page.wait_for_selector("#hand table")
    frame = page.frame_locator("#players iframe")
    frame.locator("body.by-hand").wait_for()
    track = frame.locator(".lane", has_text="the pedestrian").locator(".track").first
    track.scroll_into_view_if_needed()
    box = track.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + box["width"] / 20, y, steps=4)
    page.mouse.up()
    page.wait_for_selector("#log .answer >> nth=1")
    wait_until_free(page)
    assert re.search("comes|refused|version 2", page.inner_text("#log"))


def test_a_backend_is_chosen_and_keys_stay_unseen(page: Page) -> None:
    page.click("#open-settings")
    page.fill("#backend-name", "nonsense")
    page.click("#settings-form button[type=submit]")
    expect(page.locator("#settings-said")).to_contain_text("a backend is")
    assert "OPENAI_API_KEY" in page.inner_text("#keys")
    keep_picture(page, "settings")
    page.keyboard.press("Escape")
    page.focus("#tab-talking")
    page.keyboard.press("ArrowRight")
    assert page.is_visible("#batch-drop")


def test_a_map_is_dropped_its_junction_chosen_and_used(page: Page, tmp_path: Path) -> None:
    if page.evaluate("() => ask('/api/start')")["missing"]:
        pytest.skip("an import needs scenewright[maps]")
    name = f"own{(page.viewport_size or {'width': 0})['width']}"
    page.set_input_files("#own-file", str(write_osm(tmp_path / f"{name}.osm")))
    page.wait_for_selector("#own-map .junction >> nth=1")
    page.locator("#own-map").scroll_into_view_if_needed()
    keep_picture(page, "own-map")
    page.click("#own-map .junction >> nth=1")
    page.click("#own-import")
    said = page.locator("#own-said")
    expect(said).not_to_have_text(re.compile("^Importing"), timeout=WAIT)
    place = page.locator(f"#places button:has-text('{name}')")
    place.click()
    assert place.get_attribute("aria-pressed") == "true"
    chosen = place.locator("strong").inner_text()
    say(page, "A normal morning")
    answer = page.evaluate(
        "thread => ask(`/api/threads/${thread}`).then((found) => found.setting.intersection)",
        page.input_value("#thread"),
    )
    assert answer == chosen
    page.click("#new")
    page.set_input_files(
        "#own-file", {"name": "broken.osm", "mimeType": "text/xml", "buffer": b"<osm"}
    )
    expect(page.locator("#own-said")).to_have_class(re.compile("bad"))


def write_osm(file: Path) -> Path:
    """Two junctions of four streets, 900 m apart."""
    spots, ways = {}, []
    for c, x0 in enumerate((0.0, 900.0)):
        spots[100 * c + 1] = (x0, 0.0)
        for i, (dx, dy) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1)), start=1):
            spots[100 * c + 10 * i] = (x0 + 110.0 * dx, 110.0 * dy)
            spots[100 * c + 10 * i + 1] = (x0 + 220.0 * dx, 220.0 * dy)
            ways.append((100 * c + 1, 100 * c + 10 * i, 100 * c + 10 * i + 1))
    nodes = [
        f'<node id="{name}" lat="{48 + y / 111195:.8f}" lon="{9 + x / 74405:.8f}"/>'
        for name, (x, y) in spots.items()
    ]
    tags = '<tag k="highway" v="secondary"/><tag k="lanes" v="2"/><tag k="name" v="<b>x</b>"/>'
    tags = tags.replace("<b>x</b>", "&lt;b&gt;x&lt;/b&gt;")
    lines = []
    for n, way in enumerate(ways, start=1000):
        refs = "".join(f'<nd ref="{each}"/>' for each in way)
        lines.append(f'<way id="{n}">{refs}{tags}</way>')
    text = f'<osm version="0.6">{"".join(nodes + lines)}</osm>'
    file.write_text(text, encoding="utf-8")
    return file


def list_faults(page: Page) -> list[str]:
    from axe_playwright_python.sync_playwright import Axe

    found: list[Any] = Axe().run(page).response["violations"]
    bad = [each for each in found if each["impact"] in ("serious", "critical")]
    return [f"{each['id']}: {node['target']}" for each in bad for node in each["nodes"]]


def test_no_state_has_a_serious_fault_of_accessibility(page: Page, tmp_path: Path) -> None:
    page.click("#theme")
    assert list_faults(page) == []
    say(page, YIELD)
    say(page, "remove the tram")
    say(page, "now have it be a collision")
    assert list_faults(page) == []
    page.click("#by-hand")
    page.wait_for_selector("#hand table")
    page.click("#making")
    page.wait_for_selector("svg.run")
    page.click("#as-form")
    page.wait_for_selector("#plan .entry")
    page.select_option("#against", "1")
    page.wait_for_selector("#differences li")
    page.frame_locator("#players iframe >> nth=0").locator("#events button").first.click()
    assert list_faults(page) == []
    page.click("#theme")
    assert list_faults(page) == []
    page.click("#open-settings")
    assert list_faults(page) == []
    page.keyboard.press("Escape")
    page.click("#new")
    if page.evaluate("() => ask('/api/start')")["missing"] is None:
        page.set_input_files("#own-file", str(write_osm(tmp_path / "own.osm")))
        page.wait_for_selector("#own-map .junction >> nth=1")
    assert list_faults(page) == []
    page.click("#tab-batch")
    assert list_faults(page) == []
