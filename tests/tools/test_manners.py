"""How people give way: rolling, standing as long and as far off as was seen, and its file."""

from __future__ import annotations

import json
from itertools import islice

import numpy as np
import pytest
from solver_actors import BARE, EAST, NORTH, WESTBOUND, candidate, law, straight

from scenewright.errors import InputError
from scenewright.intersections import bundle_folder
from scenewright.scene.constraints import GivesWay, Headway
from scenewright.scene.manners import LEVELS, Manners, drawn
from scenewright.tools.dsl_validator.stage import Stage
from scenewright.tools.dsl_validator.staging import Staging
from scenewright.tools.gmm_sampler.manners import FILE, load_manners, to_json

CAR_1, CAR_2 = "vehicle-1", "vehicle-2"
EASTWARDS = candidate(straight((-60.0, 0.0), EAST, 120.0))
NORTHWARDS = candidate(straight((0.0, -60.0), NORTH, 120.0), route=WESTBOUND, time_law=law(8.0))
GIVES_WAY = GivesWay(first=CAR_1, second=CAR_2)
PAIR = ("vehicle", "vehicle")


def always(value: float) -> tuple[float, ...]:
    return (value,) * len(LEVELS)


def manners(**told) -> Manners:
    usual = {
        "rolls": 0.0,
        "pace": always(0.2),
        "place": always(4.0),
        "margin": always(1.5),
        "gap": always(1.5),
        "stands": always(2.5),
        "reacts": always(0.5),
    }
    return Manners(**{**usual, **told})


def stagings(habits, *, seed=0, clauses=(GIVES_WAY,), most=3):
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS}
    rng = np.random.default_rng(seed)
    stage = Stage(candidates, dict.fromkeys(candidates, BARE), rng, habits=habits)
    found = list(islice(stage.play(tuple(clauses), Staging()), most))
    assert found
    return found


@pytest.mark.parametrize("seed", range(4))
def test_who_rolls_slows_to_less_than_half_and_never_stands(seed):
    staging = stagings({PAIR: manners(rolls=1.0)}, seed=seed)[0]
    giver, other = staging.actors[CAR_1], staging.actors[CAR_2]
    [stop] = giver.stops
    assert stop.rolls
    assert stop.until == stop.start
    lowest = giver.motion.speed.min()
    assert 0.3 < lowest < 0.5 * giver.motion.speed.max()
    # It was slowest where it was seen to be, and came in after the other had left.
    [happening] = staging.happenings
    assert happening.freed < happening.ends
    assert happening.ends - happening.freed == pytest.approx(1.5, abs=0.4)
    assert other.motion is other.free or not other.stops


def test_on_whose_stop_others_depend_never_rolls():
    follow = Headway(first="vehicle-3", second=CAR_1, low=1.0, high=3.0)
    behind = candidate(straight((-60.0, 0.0), EAST, 120.0))
    candidates = {CAR_1: EASTWARDS, CAR_2: NORTHWARDS, "vehicle-3": behind}
    stage = Stage(
        candidates,
        dict.fromkeys(candidates, BARE),
        np.random.default_rng(0),
        habits={PAIR: manners(rolls=1.0)},
    )
    found = next(stage.play((GIVES_WAY, follow), Staging()))
    assert not any(stop.rolls for stop in found.actors[CAR_1].stops)


@pytest.mark.parametrize("gap", [1.5, 3.0, 6.0])
def test_it_stands_as_far_off_as_people_were_seen_to(gap):
    staging = stagings({PAIR: manners(gap=always(gap))})[0]
    [stop] = staging.actors[CAR_1].stops
    assert not stop.rolls
    assert stop.ahead == pytest.approx(gap, abs=0.01)


@pytest.mark.parametrize("reacts", [0.2, 1.0, 2.0])
def test_it_starts_as_soon_as_people_were_seen_to(reacts):
    staging = stagings({PAIR: manners(reacts=always(reacts))})[0]
    [stop], [happening] = staging.actors[CAR_1].stops, staging.happenings
    assert stop.until - happening.freed == pytest.approx(reacts, abs=0.15)


def test_draws_lie_between_the_outermost_quantiles():
    quantiles = tuple(float(k) for k in range(len(LEVELS)))
    rng = np.random.default_rng(0)
    values = [drawn(quantiles, rng) for _ in range(300)]
    assert 0.0 <= min(values) < 1.0
    assert len(LEVELS) - 2 < max(values) <= len(LEVELS) - 1


def test_the_shipped_habits_roll_now_and_then():
    habits = load_manners(bundle_folder("amsterdam_120"))
    assert 0.05 < habits["vehicle", "pedestrian"].rolls < 0.3
    assert 0.05 < habits["vehicle", "vehicle"].rolls < 0.4


def test_a_bundle_without_habits_borrows_the_shipped_ones(tmp_path):
    assert load_manners(tmp_path) == load_manners(bundle_folder("amsterdam_120"))


def _bundle(folder, text):
    import hashlib

    (folder / FILE).write_text(text, encoding="utf-8")
    digest = hashlib.sha256(text.encode()).hexdigest()
    header = f'name = "here"\nformat = 1\n[sha256]\n"{FILE}" = "{digest}"\n'
    (folder / "bundle.toml").write_text(header, encoding="utf-8")
    return folder


def test_habits_are_read_as_they_were_written(tmp_path):
    habits = {PAIR: manners(rolls=0.25)}
    assert load_manners(_bundle(tmp_path, to_json(habits))) == habits


@pytest.mark.parametrize("gap", [[1.0, 2.0], list(range(11))[::-1]])
def test_quantiles_that_are_none_are_refused(tmp_path, gap):
    told = json.loads(to_json({PAIR: manners()}))
    told["vehicle to vehicle"]["gap"] = gap
    with pytest.raises(InputError, match="gap needs 11 ascending quantiles"):
        load_manners(_bundle(tmp_path, json.dumps(told)))
