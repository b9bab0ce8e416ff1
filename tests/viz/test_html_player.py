"""The page: its data are the scene's, no text becomes markup, and a browser shows the proof."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from scenewright.errors import InputError
from scenewright.scene.account import AccountEntry
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord
from scenewright.viz.html_player import build_player, encode_for_script, write_player

HOSTILE = "A car </script><script>document.title='owned'</script><img src=x onerror=alert(1)>"
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


def change_prompt(scene: SceneRecord, prompt: str) -> SceneRecord:
    return scene.model_copy(update={"meta": scene.meta.model_copy(update={"user_prompt": prompt})})


def read_data(page: str) -> dict:
    found = re.search(r'<script type="application/json" id="scene-data">(.*?)</script>', page, re.S)
    assert found is not None
    return json.loads(found[1])


def test_the_page_holds_every_track_and_the_proof(
    scene: SceneRecord, proof: Proof, intersection: IntersectionMap
) -> None:
    data = read_data(build_player(scene=scene, proof=proof, intersection=intersection))
    tracks = {each["id"]: each for each in data["agents"]}
    for agent in scene.agents:
        kept = tracks[agent.id]
        assert kept["start"] == pytest.approx(agent.spawn_time)
        assert len(kept["xy"]) == len(kept["heading"]) == len(agent.trajectory)
        assert kept["xy"][7] == pytest.approx(agent.trajectory[7], abs=0.006)
    (event,) = data["events"]
    assert (event["from"], event["to"], event["time"]) == (1, 2, 8.2)
    assert event["evidence"] == {"pet": 2.4, "clearance": 2.1, "lowest_speed": 0.0}
    assert data["proof"]["verified"] is True


def test_words_have_their_state_and_their_place_in_all_the_texts(
    scene: SceneRecord, proof: Proof, intersection: IntersectionMap
) -> None:
    texts = ("A car yields, a dog barks", "make the car a bus")
    entries = (
        AccountEntry(start=2, end=5, words="car", state="seen", claim="class car", agents=(1,)),
        AccountEntry(start=16, end=19, words="dog", state="not_shown", evidence="no animals"),
        AccountEntry(turn=1, start=15, end=18, words="bus", state="seen", agents=(1,)),
    )
    checked = proof.model_copy(update={"account": entries})
    talked = change_prompt(scene, "; then: ".join(texts))
    data = read_data(build_player(scene=talked, proof=checked, intersection=intersection))
    prompt = data["meta"]["user_prompt"]
    assert [prompt[each["start"] : each["end"]] for each in data["account"]] == [
        "car",
        "dog",
        "bus",
    ]
    assert [each["state"] for each in data["account"]] == ["seen", "not_shown", "seen"]
    assert data["proof"]["verdict"] == "partly: 'dog' not shown"
    assert "said" not in data
    unchecked = read_data(build_player(scene=talked, proof=None, intersection=intersection))
    assert unchecked["account"] == []


def test_no_text_of_a_scene_becomes_markup(
    scene: SceneRecord, proof: Proof, intersection: IntersectionMap
) -> None:
    page = build_player(scene=change_prompt(scene, HOSTILE), proof=proof, intersection=intersection)
    assert "<img" not in page
    assert page.count("<script") == 2
    assert "default-src 'none'" in page
    assert read_data(page)["meta"]["user_prompt"] == HOSTILE


def test_a_prompt_that_names_a_mark_of_the_template_is_kept_as_it_is(
    scene: SceneRecord, intersection: IntersectionMap
) -> None:
    page = build_player(
        scene=change_prompt(scene, "@@SCRIPT@@"), proof=None, intersection=intersection
    )
    assert read_data(page)["meta"]["user_prompt"] == "@@SCRIPT@@"


def test_numbers_that_are_not_finite_are_refused() -> None:
    with pytest.raises(InputError, match="not finite"):
        encode_for_script({"speed": float("nan")})


@pytest.mark.skipif(BROWSER is None, reason="needs a Chromium")
def test_a_browser_shows_the_words_the_proof_and_no_error(
    tmp_path: Path, scene: SceneRecord, proof: Proof, intersection: IntersectionMap
) -> None:
    entries = (
        AccountEntry(start=0, end=5, words="A car", state="seen", claim="class car", agents=(1,)),
        AccountEntry(start=8, end=14, words="script", state="not_shown", evidence="<b>no</b>"),
    )
    hostile = change_prompt(scene, HOSTILE)
    checked = proof.model_copy(update={"account": entries})
    write_player(tmp_path / "page.html", scene=hostile, proof=checked, intersection=intersection)
    done = subprocess.run(
        [
            *(str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu"),
            *("--enable-logging=stderr", "--virtual-time-budget=1000"),
            *(f"--user-data-dir={tmp_path}/profile", "--dump-dom"),
            (tmp_path / "page.html").as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    shown = done.stdout
    assert "CONSOLE" not in done.stderr
    assert re.search(r'<mark class="seen"[^>]*>A car</mark> &lt;/<mark class="not_shown"', shown)
    assert "<td>car (the car)</td>" in shown
    assert '<td class="state">not shown</td><td></td><td>&lt;b&gt;no' in shown
    assert "<title>A car &lt;/script" in shown
    assert '<h2 id="verdict" class="amber">✓ Partly: \'script\' not shown</h2>' in shown
    assert "8.2 s: the car yields to the pedestrian" in shown
