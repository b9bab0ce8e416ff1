"""`verify` proves the whole file: by tracks and map what they decide, by the digest the rest."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from scenewright import synthesize, verify
from scenewright.cli.main import main
from scenewright.errors import InputError
from scenewright.graph.scene_files import encode_scene, load_scene
from scenewright.scene.digest import digest_json, digest_scene
from scenewright.scene.record import SceneRecord

Json = dict[str, Any]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "yield"
    text = "A vehicle yields to a pedestrian at 8 am"
    return synthesize(text, seed=7, refiner="none").save(folder)


@pytest.fixture
def copied(made: Path, tmp_path: Path) -> Path:
    for name in ("scene.json", "proof.json"):
        (tmp_path / name).write_bytes((made / name).read_bytes())
    return tmp_path


def rewrite(file: Path, forge: Callable[[Json], object]) -> None:
    content = json.loads(file.read_bytes())
    forge(content)
    file.write_text(json.dumps(content))


def find_rules(folder: Path, *, strict: bool = False) -> set[str]:
    proof = verify(folder, strict=strict)
    found = {each.rule for each in (*proof.missing, *proof.interference, *proof.implausible)}
    assert proof.verified == (not found)
    return found


def test_what_was_made_is_proven_whole(made: Path) -> None:
    proof = json.loads((made / "proof.json").read_bytes())
    assert proof["scene_digest"] == digest_json((made / "scene.json").read_bytes())
    assert find_rules(made, strict=True) == set()


def test_a_digest_is_that_of_the_values_and_of_nothing_else() -> None:
    one = digest_json(b'{"a": 1.0, "b": [2.50, -3.0e1], "c": "x"}')
    assert one == digest_json(b'{"c":"\\u0078","b":[2.5,-30],"a":1}')
    others = (
        b'{"a": 1.5, "b": [2.5, -30], "c": "x"}',
        b'{"a": 1, "b": [2.5, 30], "c": "x"}',
        b'{"a": 1, "b": [2.5, -30], "c": "y"}',
    )
    texts = [
        b'{"c": "1.0,"}',
        b'{"c": "1,"}',
        b'{"c": "1\\\\d0,"}',
        b'{"c": ["1.0]"]}',
        b'{"c": ["1]"]}',
    ]
    assert len({one, *map(digest_json, (*others, *texts))}) == 1 + len(others) + len(texts)


@pytest.mark.parametrize("value", [0.5, -0.0, 2.0, 0.00001234, -1e-7, 1e16, 123456.0])
def test_the_digest_of_a_scene_is_that_of_its_file(made: Path, value: float) -> None:
    scene = load_scene(made)
    agent = scene.agents[0]
    changes = {"heading": (value, *agent.heading[1:]), "name": 'a "." \\ é "waypoints":[1.0]'}
    changes["waypoints"] = ((value, 1.0), *agent.waypoints[1:])
    scene = scene.model_copy(
        update={"agents": (agent.model_copy(update=changes), *scene.agents[1:])}
    )
    assert digest_scene(scene) == digest_json(encode_scene(scene))


def test_the_way_in_which_a_file_is_written_does_not_matter(copied: Path) -> None:
    file = copied / "scene.json"
    content = json.loads(file.read_bytes(), parse_float=float)
    content["meta"]["timestamp"] = int(content["meta"]["timestamp"])
    file.write_text(json.dumps(content, indent=2, sort_keys=True))
    assert find_rules(copied, strict=True) == set()


@pytest.mark.parametrize(
    "forge",
    [
        lambda s: s["meta"].update(user_prompt=s["meta"]["user_prompt"] + " "),
        lambda s: s["meta"].update(density="high"),
        lambda s: s["meta"].update(seed=8),
        lambda s: s["agents"][0].update(length=4.61),
        lambda s: s["agents"][0].update(subtype=None),
        lambda s: s.update(said=[]),
    ],
    ids=["instruction", "density", "seed", "length", "subtype", "said"],
)
def test_what_tracks_and_map_cannot_betray_the_digest_does(
    copied: Path, forge: Callable[[Json], object]
) -> None:
    rewrite(copied / "scene.json", forge)
    assert find_rules(copied) == find_rules(copied, strict=True) == {"scene_changed"}
    (copied / "proof.json").unlink()
    assert find_rules(copied) == set()
    assert find_rules(copied, strict=True) == {"proof_missing"}


def relabel_crosswalk(scene: Json) -> None:
    walker = scene["agents"][1]
    old = walker["crosswalk"]
    new = {"south": "north", "north": "south", "east": "west", "west": "east"}[old]
    x, y = walker["goal"]
    goal = [x, -y] if old in ("north", "south") else [-x, y]
    walker.update(crosswalk=new, route=walker["route"].replace(f":{old}:", f":{new}:"), goal=goal)


def keep_on(scene: Json) -> None:
    for agent in scene["agents"]:
        for segment in agent["segments"]:
            segment["status"] = "keep"


def make_background(scene: Json) -> None:
    for agent in scene["agents"]:
        agent["role"] = "background"


@pytest.mark.parametrize(
    ("forge", "rule"),
    [
        (relabel_crosswalk, "waypoints_contradicted"),
        (keep_on, "segments_contradicted"),
        (make_background, "metadata_contradicted"),
        (lambda s: s.update(events=[]), "label_missing"),
        (lambda s: s.update(relations=[]), "metadata_contradicted"),
        (lambda s: s["meta"].update(timestamp=0.0), "metadata_contradicted"),
        (lambda s: s["meta"].update(map_id=1), "metadata_contradicted"),
        (lambda s: s["meta"].update(user_prompt="A bus"), "metadata_contradicted"),
        (lambda s: s["agents"][0].update(subtype="submarine"), "metadata_contradicted"),
        (lambda s: s["agents"][0].update(name="vehicle-2"), "metadata_contradicted"),
        (
            lambda s: s["agents"][0].update(
                waypoints=[[x + 50.0, y] for x, y in s["agents"][0]["waypoints"]]
            ),
            "waypoints_contradicted",
        ),
    ],
)
def test_a_contradiction_within_the_file_is_found_without_a_proof(
    copied: Path, forge: Callable[[Json], object], rule: str
) -> None:
    (copied / "proof.json").unlink()
    assert find_rules(copied) == set()
    rewrite(copied / "scene.json", forge)
    assert rule in find_rules(copied)


def test_a_proof_that_says_other_things_is_reported(copied: Path) -> None:
    rewrite(copied / "proof.json", lambda p: p["figures"].update(agents=3))
    assert find_rules(copied) == set()
    assert find_rules(copied, strict=True) == {"proof_contradicted"}
    rewrite(copied / "proof.json", lambda p: p["events"][0].update(time=1.0))
    assert find_rules(copied) == {"proof_contradicted"}
    (copied / "proof.json").write_text("{}")
    with pytest.raises(InputError, match="is not a proof"):
        verify(copied)


@pytest.mark.parametrize(
    ("before", "after", "given"),
    [
        ('"schema_version":1,', "", "schema_version is missing"),
        ('"seed":7', '"seed":7,"seed":7', "twice"),
        ('"seed":7', '"seed":7,"density":null', "twice"),
        ('"timestamp":28800.0', '"timestamp":NaN', "NaN is not a number"),
        ('"timestamp":28800.0', '"timestamp":1e999', "not JSON compliant"),
    ],
)
def test_a_file_that_can_be_read_in_two_ways_is_none(
    copied: Path, before: str, after: str, given: str
) -> None:
    file = copied / "scene.json"
    text = file.read_text()
    assert before in text
    file.write_text(text.replace(before, after, 1))
    with pytest.raises(InputError, match=given):
        verify(copied)


def test_an_empty_path_is_not_the_current_folder(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(copied)
    with pytest.raises(InputError, match="empty"):
        load_scene("")


def test_a_provenance_names_the_scene_that_it_is_of(copied: Path, made: Path) -> None:
    about = json.loads((made / "provenance.json").read_bytes())
    assert about["scene_digest"] == digest_json((copied / "scene.json").read_bytes())
    (copied / "provenance.json").write_text(json.dumps(about))
    assert find_rules(copied, strict=True) == set()
    (copied / "provenance.json").write_text(json.dumps({**about, "scene_digest": "sha256:0"}))
    assert find_rules(copied) == set()
    assert find_rules(copied, strict=True) == {"provenance_contradicted"}


def test_what_strict_has_not_looked_at_is_named(
    copied: Path, made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("provenance.json", "scene.png"):
        (copied / name).write_bytes((made / "provenance.json").read_bytes())
    assert main(["verify", "--strict", str(copied)]) == 0
    assert "not looked at: provenance.json but for the digest, scene.png" in capsys.readouterr().err
    assert main(["verify", str(copied), "--json"]) == 0
    assert "unchecked" not in json.loads(capsys.readouterr().out)["scenes"][0]


@pytest.mark.parametrize("name", ["scene.json", "proof.json", "provenance.json"])
def test_a_key_twice_is_refused(copied: Path, made: Path, name: str) -> None:
    data = (made / name).read_text()
    first = next(iter(json.loads(data)))
    (copied / name).write_text(f'{{"{first}": null,{data[1:]}')
    with pytest.raises(InputError, match=rf"{name} is .*'{first}' stands there twice"):
        verify(copied, strict=True)


@pytest.mark.parametrize(
    ("name", "row"),
    [
        ("relations", {"type": "yielding", "from": 1, "to": 2}),
        ("ties", {"agent": 1, "of": 2, "side": "left"}),
        ("sights", {"observer": 1, "subject": 2, "object": "box-1", "lead": [0, 1]}),
    ],
)
def test_more_relations_than_pairs_are_refused(copied: Path, name: str, row: Json) -> None:
    rewrite(copied / "scene.json", lambda scene: scene.update({name: [row] * 20_000}))
    with pytest.raises(InputError, match=f"it has 20000 {name}; a scene of"):
        verify(copied)
    scene = json.loads((copied / "scene.json").read_bytes())
    with pytest.raises(InputError, match=f"it has 20000 {name}; a scene of"):
        verify(SceneRecord.model_validate(scene))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize("name", ["proof.json", "provenance.json"])
def test_a_pipe_beside_a_scene_is_refused(copied: Path, name: str) -> None:
    (copied / name).unlink(missing_ok=True)
    os.mkfifo(copied / name)
    with pytest.raises(InputError, match=f"cannot read .*{name}: it is a device or a pipe"):
        verify(copied, strict=True)
