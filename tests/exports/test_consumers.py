"""Scenes played by other simulators, whose own tests must find exactly our collisions.

Consumers are scripts in `consumers/`, each run with the interpreter `<folder>/<name>/bin/python`,
where the folder is named by SCENEWRIGHT_EXPORTS or lies in the environment of the tests, as `make
exports` lays it. A consumer that is not installed is skipped. SCENEWRIGHT_EXPORT_SCENES says how
many scenes, or names a folder that holds them. ESMINI names the library of esmini, which is in no
package index.
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

import scenewright
from scenewright.errors import ScenewrightError
from scenewright.graph.scene_files import load_scene
from scenewright.intersections import load_map
from scenewright.scene.kinds import has_trait
from scenewright.scene.record import SceneRecord
from scenewright.tools.formats import prepare_scene
from scenewright.tools.formats.womd import CURRENT, EVENT, WINDOW

FOLDER, SCENES = "SCENEWRIGHT_EXPORTS", "SCENEWRIGHT_EXPORT_SCENES"
STEP = 0.1
TEXTS = (
    "A vehicle yields to a pedestrian at 8 am",
    "A car hits a pedestrian on the crosswalk at 8 am",
    "A car from the north turning left collides with an oncoming truck",
    "A car narrowly misses a pedestrian on the east crosswalk",
    "Normal traffic at noon, light",
    "A car from the east runs the red light and collides with a car from the south",
    "A bus from the north yields to a pedestrian on the east crosswalk",
    "A car rear-ends the car ahead of it",
    "A motorcycle follows a truck from the west",
    "A van from the north narrowly misses a man on the east crosswalk",
    "A truck from the south turning right hits a pedestrian",
    "Two cars narrowly miss each other in the junction, dense traffic at 5 pm",
    "A car from the west turning left yields to an oncoming car",
    "A jaywalking pedestrian is hit by a car on the north leg",
    "A motorcycle from the east hits a car from the north",
    "Two cars collide head on",
    "A car turning right hits a cyclist going straight at 9 am",
    "A car from the south narrowly misses a scooter on the east crosswalk",
    "A bus from the west collides with a truck from the north",
    "A pedestrian crosses behind a parked van and is hit by a car",
    "A car yields to a pedestrian on the north crosswalk and is then rear-ended by a truck",
    "Two cars heading south sideswipe each other in heavy traffic",
    "A motorist heading north gives way to two pedestrians on the north crosswalk",
    "A taxi hits a jaywalker at 11 pm",
    "A van turning left cuts off an oncoming motorcycle",
)


@dataclass(frozen=True)
class Consumer:
    """Who reads a format.

    Attributes:
        format: it is asked with; suffix, prefix: of the file named after the scene.
        tolerance: of positions [m].
        finds: what its own test finds: every `pair`, the `ego`'s first crash, or `nothing`.
        form: in which the scenes are written; None is the usual one.
        squares: whether pedestrians, which are discs to us, are squares to it, whose corners touch
            where the discs do not.
        unseen: names of objects that it does not read, as a pattern.
        within: how far its times of contact may be from ours [s].
        script: in `consumers/` that has it play; None: that of the format.
        environment: whose interpreter plays it; None: its own.
        every: it has every so many samples of a scene's; None: those of a part of the scene.
    """

    format: str
    suffix: str
    prefix: str = ""
    tolerance: float = 1e-3
    finds: str = "pair"
    form: str | None = None
    squares: bool = False
    unseen: str = "^$"
    within: float = STEP
    script: str | None = None
    environment: str | None = None
    every: int | None = None


TABLES = Consumer("csv", ".csv", script="tables", environment="readers", every=1)
"""Formats that have no simulator: readers of tables, after which footprints are compared."""
CONSUMERS = {
    "scenario-gym": Consumer("openscenario", ".xosc", squares=True),
    "commonroad": Consumer("commonroad", ".cr.xml"),
    "metadrive": Consumer("scenarionet", ".pkl", "sd_scenewright_1_", finds="ego"),
    "omega-prime": Consumer("osi", ".mcap", squares=True, unseen="-door$"),
    "av2": Consumer("argoverse2", ".parquet", "{0}/scenario_", finds="nothing", form="whole"),
    "esmini": Consumer(
        "openscenario", ".xosc", tolerance=0.15, squares=True, within=0.15, script="esmini"
    ),
    "esmini, its drivers": Consumer(
        "openscenario",
        ".xosc",
        tolerance=3.0,
        form="reactive",
        squares=True,
        within=0.35,
        script="esmini",
    ),
    "movingpandas": replace(TABLES, format="csv", suffix=".csv", unseen="^object-"),
    "sumolib": replace(TABLES, format="fcd", suffix=".fcd.xml", unseen="^object-"),
    "waymo scenario": replace(
        TABLES, format="womd", suffix=".tfrecord", form="whole", squares=True
    ),
    "waymo example": replace(
        TABLES, format="womd", suffix=".tfexample.tfrecord", form="example", finds="nothing",
        every=None,
    ),
    "waymo rollout": replace(
        TABLES, format="wosac", suffix=".joint_scene.binproto", finds="nothing", every=None
    ),
    "trajnetplusplustools": replace(
        TABLES, format="trajnet", suffix=".ndjson", finds="nothing", every=4
    ),
    "mcap": replace(TABLES, format="foxglove", suffix=".foxglove.mcap", squares=True),
    "py-osc2": replace(TABLES, format="osc-dsl", suffix=".osc", finds="nothing", every=None),
}  # fmt: skip
ESMINI = "ESMINI"


@pytest.fixture(scope="module")
def records() -> list[SceneRecord]:
    return _load_records()


@pytest.mark.parametrize("name", CONSUMERS)
def test_a_consumer_finds_exactly_our_collisions(
    name: str, records: list[SceneRecord], tmp_path: Path
) -> None:
    consumer, python = CONSUMERS[name], _find_interpreter(name)
    scenewright.export(records, consumer.format, tmp_path, form=consumer.form)
    questions = [_describe(record, consumer, tmp_path) for record in records]
    answer = _ask(python, consumer.script or consumer.format, questions)
    pairs = list(zip(records, answer["scenes"], strict=True))
    faults = [f for record, each in pairs for f in _find_faults(record, each, consumer)]
    worst = max(each["position_error"] for each in answer["scenes"])
    collisions = sum(len(_our_collisions(record)) for record in records)
    equal = len(records) - len({fault.split(":")[0] for fault in faults})
    verdict = f"collisions equal in {equal} ({collisions} in all), "
    print(
        f"\n{name} {answer['version']} ({consumer.format}): {len(records)} scenes loaded, "
        f"{'' if consumer.finds == 'nothing' else verdict}positions within {worst:.1e} m"
    )
    assert worst < consumer.tolerance
    if consumer.every is not None:
        wanted = [_count_samples(record, consumer.every) for record in records]
        assert [each["samples"] for each in answer["scenes"]] == wanted
    assert not faults, "\n".join(faults)


def _count_samples(record: SceneRecord, every: int) -> int:
    firsts = [round(agent.spawn_time / STEP) for agent in record.agents]
    spans = zip(firsts, record.agents, strict=True)
    return sum(
        k % every == 0 for first, a in spans for k in range(first, first + len(a.trajectory))
    )


def _find_interpreter(name: str) -> Path:
    if CONSUMERS[name].script == "esmini":
        if ESMINI not in os.environ:
            pytest.skip("ESMINI does not name the library of esmini")
        return Path(sys.executable)
    folder = Path(os.environ.get(FOLDER, Path(sys.prefix) / "exports"))
    python = folder / (CONSUMERS[name].environment or name) / "bin" / "python"
    if not python.exists():
        pytest.skip(f"{name} is not installed; `make exports` installs it")
    return python


def _load_records() -> list[SceneRecord]:
    """The scenes of a folder, or as many as are asked for, made here."""
    wanted = os.environ.get(SCENES, "16")
    if not wanted.isdigit():
        return [load_scene(each) for each in sorted(Path(wanted).glob("*/scene.json"))]
    return [_make_record(number) for number in range(int(wanted))]


def _make_record(number: int) -> SceneRecord:
    """A scene of the text whose turn it is; another seed where this one has none."""
    for seed in range(number, number + 10_000, 1000):
        try:
            return scenewright.synthesize(TEXTS[number % len(TEXTS)], seed=seed).record
        except ScenewrightError:
            continue
    raise AssertionError(f"no scene of {TEXTS[number % len(TEXTS)]!r}")


def _describe(record: SceneRecord, consumer: Consumer, folder: Path) -> dict[str, Any]:
    name = record.meta.scene_id
    agents = {
        agent.name: {
            "id": agent.id,
            "t": [round(agent.spawn_time + k * STEP, 3) for k in range(len(agent.trajectory))],
            "xy": agent.trajectory,
        }
        for agent in record.agents
    }
    first = max(agent.id for agent in record.agents) + 1
    objects = {each.id: number for number, each in enumerate(record.objects, start=first)}
    file = folder / f"{consumer.prefix.format(name)}{name}{consumer.suffix}"
    steps = round(record.meta.duration / STEP) + 1
    shift = 0
    if consumer.form == "example":  # a window of the scene, on a clock of its own
        prepared = prepare_scene(record, load_map(record.meta.intersection))
        shift = prepared.cut_window(WINDOW, now=CURRENT, event=EVENT).offset
    discs = [agent.name for agent in record.agents if agent.type == "pedestrian"]
    return {
        "file": str(file), "step": STEP, "steps": steps, "agents": agents, "objects": objects,
        "discs": [] if consumer.squares else discs, "shift": shift,
    }  # fmt: skip


def _ask(python: Path, script: str, questions: list[dict[str, Any]]) -> dict[str, Any]:
    file = Path(__file__).parent / "consumers" / f"play_{script}.py"
    done = subprocess.run(
        [str(python), "-W", "ignore", str(file)],
        input=json.dumps({"scenes": questions}), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    answer: dict[str, Any] = json.loads(done.stdout[done.stdout.index('{"version"') :])
    return answer


def _our_collisions(record: SceneRecord) -> dict[tuple[str, str], float]:
    names = {agent.id: agent.name for agent in record.agents}
    found = {}
    for event in record.events:
        if event.type == "collision" and event.time is not None:
            one, two = sorted((names[event.from_ or 0], names[event.to or 0]))
            found[one, two] = event.time
    there = {each.id for each in record.objects}
    for hit in record.encounters:
        if has_trait("encounter", hit.how, "ends"):
            (agent,) = (each for each in record.agents if each.id == hit.agent)
            door = f"{hit.object}-door"
            end = agent.spawn_time + STEP * (len(agent.trajectory) - 1)
            one, two = sorted((agent.name, door if door in there else hit.object))
            found[one, two] = end
    return found


def _find_faults(record: SceneRecord, answer: dict[str, Any], consumer: Consumer) -> list[str]:
    """How its findings differ from ours, one line each, the scene's id first."""
    ours, where = _our_collisions(record), record.meta.scene_id
    if consumer.finds == "nothing":
        return []
    if consumer.finds == "ego":
        return [f"{where}: {text}" for text in _compare_crash(record, answer, ours)]
    theirs = {(a, b): t for a, b, t in answer["collisions"]}
    ours = {
        pair: t for pair, t in ours.items() if not any(re.search(consumer.unseen, n) for n in pair)
    }
    faults = [f"missed {pair} at {ours[pair]} s" for pair in ours.keys() - theirs.keys()]
    faults += [
        f"invented {pair} at {theirs[pair]} s"
        for pair in theirs.keys() - ours.keys()
        if not (consumer.squares and _touch_at_corners(record, pair, theirs[pair]))
    ]
    faults += [
        f"{pair} at {theirs[pair]} s, ours {ours[pair]} s"
        for pair in ours.keys() & theirs.keys()
        if abs(theirs[pair] - ours[pair]) > consumer.within + 1e-6
    ]
    return [f"{where}: {fault}" for fault in faults]


def _touch_at_corners(record: SceneRecord, pair: tuple[str, str], time: float) -> bool:
    """Whether two pedestrians are as near as squares may touch, but discs do not."""
    agents = [agent for agent in record.agents if agent.name in pair]
    if any(agent.type != "pedestrian" for agent in agents):
        return False
    steps = [round((time - agent.spawn_time) / STEP) for agent in agents]
    one, two = (
        a.trajectory[min(k, len(a.trajectory) - 1)] for a, k in zip(agents, steps, strict=True)
    )
    reach = sum(agent.length for agent in agents) / 2
    return reach < math.dist(one, two) <= math.sqrt(2.0) * reach + 0.1


def _compare_crash(
    record: SceneRecord, answer: dict[str, Any], ours: dict[tuple[str, str], float]
) -> list[str]:
    """The first crash of the ego, by what it is with, and when."""
    ego = next(agent.name for agent in record.agents if str(agent.id) == answer["ego"])
    mine = [(t, pair) for pair, t in ours.items() if ego in pair]
    if not mine or answer["crash"] is None:
        crash = answer["crash"]
        return [] if not mine and crash is None else [f"crash {crash}, ours {mine}"]
    (time, pair), (what, when) = min(mine), answer["crash"]
    other = next(name for name in pair if name != ego)
    kinds = {agent.name: agent.type for agent in record.agents}
    kinds |= {each.id: "vehicle" if each.subtype else "object" for each in record.objects}
    struck = kinds[other] if kinds[other] in ("vehicle", "object") else "person"
    # MetaDrive's objects are barriers 2 m wide, twice as wide as a door.
    early = time - when if struck == "object" else 0.0
    if struck != what or (abs(when - time) > STEP + 1e-6 and not 0.0 < early < 0.25):
        return [f"crash with a {what} at {when} s, ours with {other} at {time} s"]
    return []
