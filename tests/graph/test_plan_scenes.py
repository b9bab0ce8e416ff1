"""Scenes of plans: as those of their texts, with the fields as claims where there is none."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from inline_jobs import run_jobs_inline
from scenewright import synthesize, verify
from scenewright.cli.main import main
from scenewright.errors import InputError
from scenewright.graph.run import plan_instruction
from scenewright.graph.scene_files import encode_scene
from scenewright.scene.plan_file import format_plan, read_plan
from scenewright.scene.social import SocialGraph

YIELD = {
    "agents": [{"id": "vehicle-1", "subtype": "truck", "movement": "left"}, {"id": "pedestrian-1"}],
    "relations": [{"type": "yield_to", "from": "vehicle-1", "to": "pedestrian-1"}],
    "context": {"time_of_day": "08:00", "density": "low"},
}
SWEEP = """\
agents:
  - {id: vehicle-1, subtype: [car, truck]}
  - id: pedestrian-1
relations:
  - {type: near_miss, from: vehicle-1, to: pedestrian-1, target_pet: 0.8 .. 9 s}
context: {density: low}
"""


@pytest.mark.parametrize(
    "text",
    [
        "A northbound car turning left yields to an oncoming bus.",
        "A taxi hits a jaywalker at 11 pm.",
        "A car stops for two seconds before the crosswalk and then yields to a pedestrian.",
    ],
)
def test_a_plan_makes_the_scene_of_its_text(tmp_path: Path, text: str) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(format_plan(plan_instruction(text), text), encoding="utf-8")
    said, written = (synthesize(each, seed=1, refiner="none") for each in (text, read_plan(file)))
    assert encode_scene(written.record) == encode_scene(said.record)
    assert written.proof == said.proof


def test_fields_are_the_claims_of_a_plan_without_words() -> None:
    scene = synthesize(read_plan(YIELD), seed=1, refiner="none")
    words = {each.words: each.state for each in scene.proof.account}
    assert words == dict.fromkeys(
        ["vehicle-1", "subtype truck", "movement left", "pedestrian-1",
         "vehicle-1 yield_to pedestrian-1", "density low", "time_of_day 08:00"], "seen",
    )  # fmt: skip
    text = scene.record.meta.user_prompt
    assert [text[e.start : e.end] for e in scene.proof.account] == list(words)
    assert verify(scene, strict=True).account == scene.proof.account


@pytest.mark.parametrize(
    ("section", "changed", "words"),
    [
        ("agents", {"subtype": "bus"}, "subtype bus"),
        ("agents", {"movement": "right"}, "movement right"),
        ("agents", {"entry": "northeast"}, "entry northeast"),
        ("agents", {"runs_red": True}, "runs_red True"),
        ("agents", {"reaction": "swerves"}, "reaction swerves"),
        ("relations", {"type": "near_miss"}, "vehicle-1 near_miss pedestrian-1"),
        ("relations", {"target_pet": 1.0}, "target_pet 1"),
        ("relations", {"first": "vehicle-1"}, "first vehicle-1"),
        ("context", {"density": "high"}, "density high"),
        ("context", {"time_of_day": "09:00"}, "time_of_day 09:00"),
    ],
)
def test_a_claim_that_is_false_is_contradicted(
    section: str, changed: dict[str, object], words: str
) -> None:
    scene = synthesize(read_plan(YIELD), seed=1, refiner="none").record
    plan = scene.meta.plan
    assert plan is not None
    data = plan.model_dump(by_alias=True)
    part = data[section] if section == "context" else data[section][0]
    part |= changed
    meta = scene.meta.model_copy(update={"plan": SocialGraph.model_validate(data)})
    proof = verify(scene.model_copy(update={"meta": meta}))
    assert not proof.verified
    assert words in [each.words for each in proof.list_words("contradicted")]


def test_an_edited_plan_is_drawn_as_before(tmp_path: Path) -> None:
    text = "A car hits a pedestrian at 8 am"
    file = tmp_path / "scene.yaml"
    written = format_plan(plan_instruction(text), text)
    file.write_text(written.replace('"08:00"', '"08:10"'), encoding="utf-8")
    scene = synthesize(read_plan(file), seed=1, refiner="none")
    assert scene.record.meta.time_of_day == "08:10"
    assert scene.record.meta.user_prompt.startswith("vehicle-1, subtype car")


def test_rows_of_a_batch_may_be_plans(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_jobs_inline(monkeypatch)
    rows = [{"id": "one", "plan": YIELD, "seed": 1}, {"id": "two", "plan": "own.yaml", "seed": 1}]
    (tmp_path / "own.yaml").write_text(json.dumps(YIELD), encoding="utf-8")
    source, out = tmp_path / "rows.jsonl", tmp_path / "out"
    source.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    words = ["batch", str(source), "--out", str(out), "--refiner", "none", "-q"]
    assert main(words) == 0
    one, two = ((out / name / "scene.json").read_bytes() for name in ("one", "two"))
    assert one == two == encode_scene(synthesize(read_plan(YIELD), seed=1, refiner="none").record)
    (tmp_path / "own.yaml").write_text(json.dumps({**YIELD, "agent": 1}), encoding="utf-8")
    assert main(words) == 2
    assert "line 2" in (said := capsys.readouterr().err)
    assert "agent: there is no such field" in said


@pytest.mark.parametrize(
    "row", [{}, {"text": "a", "plan": YIELD}, {"plan": YIELD, "overrides": {"density": "low"}}]
)
def test_a_row_has_a_text_or_a_plan(tmp_path: Path, row: dict[str, object]) -> None:
    from scenewright.dataset.batch.rows import read_source

    source = tmp_path / "rows.jsonl"
    source.write_text(json.dumps({"id": "a", **row}) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"line 1: .*plan"):
        read_source(source)


def test_a_sweep_makes_what_can_be_and_says_why_the_rest_cannot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_jobs_inline(monkeypatch)
    plan, out = tmp_path / "plan.yaml", tmp_path / "out"
    plan.write_text(SWEEP, encoding="utf-8")
    words = ["sweep", str(plan), "--n", "4", "--sampling", "boundary", "--out", str(out),
             "--refiner", "none", "-q"]  # fmt: skip
    assert main(words) == 0
    rows = list(csv.DictReader((out / "points.csv").read_text("utf-8").splitlines()))
    assert [row["relations[0].target_pet"] for row in rows] == ["0.8", "9.0", "0.8", "9.0"]
    assert [row["agents[0].subtype"] for row in rows] == ["car", "car", "truck", "truck"]
    for row in rows:
        if row["relations[0].target_pet"] == "9.0":
            assert (row["status"], row["code"]) == ("infeasible", "no_plan")
            assert "at most 8 s" in row["reason"]
        else:
            assert row["status"] == "made"
            proof = json.loads((out / row["folder"] / "proof.json").read_text("utf-8"))
            assert abs(proof["events"][0]["evidence"]["pet"] - 0.8) <= 0.15
            (event,) = proof["events"]
            assert row["relations[0].target_pet measured"] == row["pet"]
            assert float(row["pet"]) == event["evidence"]["pet"]
            assert float(row["pet_time"]) == event["when"]["pet"]["time"]
            assert (row["event"], float(row["time"])) == ("near_miss", event["time"])
            assert float(row["worst_ttc"]) == event["worst"]["path_ttc"]["value"]
            assert float(row["speed_from"]) > 0.5
            assert {"subtype " + row["agents[0].subtype"], "target_pet 0.8"} <= {
                each["words"] for each in proof["account"]
            }
    before = (out / "points.csv").read_bytes()
    assert main(words) == 0
    assert (out / "points.csv").read_bytes() == before
    plan.write_text(SWEEP.replace("0.8 ..", "0.9 .."), encoding="utf-8")
    assert main(words) == 2


@pytest.mark.parametrize("sampling", ["grid", "lhs", "sobol", "boundary"])
def test_samplings_stay_within_and_reach_lists(tmp_path: Path, sampling: str) -> None:
    from scenewright.dataset.batch.sweep import build_points
    from scenewright.scene.plan_file import read_logical_plan

    plan = tmp_path / "plan.yaml"
    plan.write_text(SWEEP, encoding="utf-8")
    points = build_points(
        read_logical_plan(plan),
        16,
        sampling=sampling,
        seed=3,
        place="amsterdam_120",  # type: ignore[arg-type]
    )
    assert len(points) == {"grid": 16, "lhs": 16, "sobol": 16, "boundary": 4}[sampling]
    subtypes, pets = zip(*(each.values.values() for each in points), strict=True)
    assert set(subtypes) == {"car", "truck"}
    assert min(pets) >= 0.8
    assert max(pets) <= 9.0
    assert max(pets) - min(pets) > 6.0


def test_a_sweep_tells_what_was_not_found_from_what_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from scenewright.dataset.batch import worker
    from scenewright.dataset.batch.sweep import measure_sweep

    tried: list[int] = []

    def run(job: worker.Job) -> worker.Outcome:
        """As if the search found only what it draws with seed 2, and no way for trucks."""
        tried.append(job.seed)
        if job.plan is not None and job.plan.plan.agents[0].subtype == "truck":
            return worker.Outcome("refused", "ungroundable", "no way")
        if job.seed == 2 and job.plan is not None and job.plan.plan.relations[0].target_pet == 0.8:
            return make(job)
        return worker.Outcome("refused", "work_spent", f"nothing with seed {job.seed}")

    make = worker._run_job
    monkeypatch.setattr(worker, "_run_job", run)
    run_jobs_inline(monkeypatch)
    plan, out = tmp_path / "plan.yaml", tmp_path / "out"
    plan.write_text(SWEEP.replace(".. 9 s", ".. 2 s"), encoding="utf-8")
    words = ["sweep", str(plan), "--n", "4", "--sampling", "boundary", "--out", str(out),
             "--refiner", "none", "-q"]  # fmt: skip
    assert main(words) == 0
    assert tried == [0, 1, 2, 0, 1, 2, 0, 0]
    rows = list(csv.DictReader((out / "points.csv").read_text("utf-8").splitlines()))
    assert [(row["status"], row["code"]) for row in rows] == [
        ("made", ""), ("not_found", "work_spent"), *[("infeasible", "ungroundable")] * 2
    ]  # fmt: skip
    assert rows[1]["reason"] == "nothing with seed 2"
    scene = json.loads((out / rows[0]["folder"] / "scene.json").read_text("utf-8"))
    assert scene["meta"]["seed"] == 2
    # A bin in which nothing was found is a gap; one that cannot be is none.
    subtype, pet = measure_sweep(out)
    assert (subtype.shut, subtype.gaps) == (("truck",), {})
    assert (pet.shut, len(pet.gaps)) == ((), 1)
    capsys.readouterr()
    assert main(["dataset", "check", str(out / "scenes")]) == 0


def test_red_lights_and_times_of_a_sweep_are_those_of_its_scenes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_jobs_inline(monkeypatch)
    plan, out = tmp_path / "plan.yaml", tmp_path / "out"
    plan.write_text(
        "agents:\n"
        "  - {id: vehicle-1, entry: west, movement: right}\n"
        "  - {id: cyclist-1, entry: [north, west], movement: straight}\n"
        "relations: [{type: near_miss, from: vehicle-1, to: cyclist-1}]\n"
        'context: {density: low, time_of_day: "07:00-09:30"}\n',
        encoding="utf-8",
    )
    words = ["sweep", str(plan), "--n", "4", "--sampling", "boundary", "--out", str(out)]
    assert main([*words, "--refiner", "none", "-q"]) == 0
    rows = list(csv.DictReader((out / "points.csv").read_text("utf-8").splitlines()))
    assert {row["context.time_of_day"] for row in rows} == {"07:00", "09:30"}
    made = [row for row in rows if row["status"] == "made"]
    assert {row["red_lights"] for row in made} == {"0", "1"}
    for row in made:
        scene = json.loads((out / row["folder"] / "scene.json").read_text("utf-8"))
        assert scene["meta"]["time_of_day"] == row["context.time_of_day"]
        capsys.readouterr()
        assert main(["verify", str(out / row["folder"])]) == 0
        said = "1 red light run unasked" in capsys.readouterr().out
        assert said == (row["red_lights"] == "1")


PLACES = """\
intersections: any
constraints:
  - vehicle-1.entry != vehicle-2.entry
  - relations[0].target_pet < measures[0].value / 5 or measures[0].value > 8
agents:
  - {id: vehicle-1, entry: has left-turn lane and crosswalk, movement: left}
  - {id: vehicle-2, entry: has 1 entry lane}
relations:
  - {type: near_miss, from: vehicle-1, to: vehicle-2, target_pet: 0.5 .. 3 s}
measures:
  - {kind: speed, agent: vehicle-1, value: 3 .. 9 m/s}
"""


@pytest.mark.parametrize("sampling", ["grid", "lhs", "sobol", "boundary"])
def test_points_fulfil_constraints_at_every_place_with_such_a_leg(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sampling: str
) -> None:
    from scenewright.dataset.batch.sweep import build_points
    from scenewright.intersections import find_bundle_folder
    from scenewright.scene.plan_file import read_logical_plan

    shipped = json.loads((find_bundle_folder("amsterdam_120") / "map.json").read_text("utf-8"))
    for name, without in (("bare", ("north", "south")), ("half", ("south",))):
        own = tmp_path / "own" / name
        own.mkdir(parents=True)
        crosswalks = [c for c in shipped["crosswalks"] if c["leg"] not in without]
        routes = [r for r in shipped["routes"] if r.get("crosswalk") not in without]
        changed = {**shipped, "name": name, "crosswalks": crosswalks, "routes": routes}
        kept = {each["id"] for each in crosswalks}
        for group in changed["signals"]["groups"]:
            group["crosswalks"] = [each for each in group["crosswalks"] if each in kept]
        (own / "map.json").write_text(json.dumps(changed), encoding="utf-8")
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path / "own"))
    plan = tmp_path / "plan.yaml"
    plan.write_text(PLACES, encoding="utf-8")
    points = build_points(
        read_logical_plan(plan),
        24,
        sampling=sampling,
        seed=3,
        place="amsterdam_120",  # type: ignore[arg-type]
    )
    entries = {place: {p.values.get(("agents", 0, "entry")) for p in points if p.place == place}
               for place in ("amsterdam_120", "bare", "half")}  # fmt: skip
    assert entries == {"amsterdam_120": {"north", "south"}, "bare": {None}, "half": {"north"}}
    assert [p.fault for p in points if p.place == "bare"] == [
        f"{plan}, line 6, agents[0].entry: no leg of bare has left-turn lane and crosswalk"
    ]
    for values in (p.values for p in points if p.place != "bare"):
        first, second, pet, speed = values.values()
        assert first != second
        assert second in ("east", "west")
        assert pet < speed / 5 or speed > 8


def test_a_sweep_happens_where_its_plan_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_jobs_inline(monkeypatch)
    plan, out = tmp_path / "plan.yaml", tmp_path / "out"
    plan.write_text(PLACES.replace("any", "amsterdam_120"), encoding="utf-8")
    assert main(["plan", str(plan)]) == 0
    words = ["sweep", str(plan), "--n", "1", "--out", str(out), "--refiner", "none", "-q"]
    assert main(words) == 0
    (row,) = csv.DictReader((out / "points.csv").read_text("utf-8").splitlines())
    assert (row["intersection"], row["status"]) == ("amsterdam_120", "made")
    plan.write_text(PLACES.replace("any", "[nowhere]"), encoding="utf-8")
    assert main([*words[:-3], "--out", str(tmp_path / "more")]) == 2
    assert "line 1, intersections: no intersection 'nowhere'" in capsys.readouterr().err
    plan.write_text(PLACES.replace("!=", "== vehicle-1.entry !="), encoding="utf-8")
    assert main([*words[:-3], "--out", str(tmp_path / "more")]) == 0


def test_commands_write_and_check_plans(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", "A car yields to a pedestrian", "--yaml", "--out", "scene.yaml"]) == 0
    assert main(["plan", "scene.yaml"]) == 0
    assert "The car yields to the pedestrian." in capsys.readouterr().out
    assert main(["plan", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "Plan of a scene"
    text = Path("scene.yaml").read_text("utf-8")
    Path("scene.yaml").write_text(text.replace("subtype: car", "subtype: tram"), encoding="utf-8")
    for words in (["plan", "scene.yaml"], ["make", "scene.yaml"]):
        assert main(words) == 2
        assert "agents[0].subtype: must be 'car'" in capsys.readouterr().err
    assert main(["make", "none.yaml"]) == 2
    assert not Path("scenes").exists()


def test_any_place_is_the_shipped_one_where_nobody_has_made_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from scenewright.dataset.batch.sweep import load_places
    from scenewright.scene.plan_file import read_logical_plan

    for name in ("SCENEWRIGHT_INTERSECTIONS", "SCENEWRIGHT_DATA"):
        monkeypatch.delenv(name, raising=False)
    for name in ("HOME", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(tmp_path / "fresh"))
    plan = tmp_path / "plan.yaml"
    plan.write_text(PLACES, encoding="utf-8")
    assert list(load_places(read_logical_plan(plan), "amsterdam_120")) == ["amsterdam_120"]
