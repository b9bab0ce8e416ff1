"""How likely a future is in company: who keeps clear of others, and of whom it does not matter."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.evals.understanding.company import company_of
from scenewright.evals.understanding.features import NAMES, mirrored, pairs_of
from scenewright.evals.understanding.futures import DT, TICKS, Future, Outlook
from scenewright.evals.understanding.intent import Fit, fits_of
from scenewright.evals.understanding.observing import Observation, Seen
from scenewright.evals.understanding.ways import ways_of

PLACE = "amsterdam_120"
SIZE = 8


def driver(id_: str) -> Seen:
    """A vehicle that has driven up the north leg."""
    ways = ways_of(PLACE, "vehicle")
    c = [each.id for each in ways.routes].index("vehicle:north>south:straight")
    s = np.arange(0.0, 12.0, 0.9)
    xy = np.stack([np.interp(s, ways.s[c], ways.curve[c, :, d]) for d in (0, 1)], axis=-1)
    heading = np.interp(s, ways.s[c], ways.heading[c])
    return Seen(
        id_, "vehicle", 0.0, xy, heading, np.full(len(s), 9.0), s, 4.6, 1.85, False
    )  # fmt: skip


def fit_of(agent: Seen) -> Fit:
    seen = Observation("00ff00ff00ff00ff", PLACE, 4.0, 12, (agent,), ())
    return fits_of(seen)[agent.id]


def future(fit: Fit, ways: list[tuple[str, np.ndarray, float]]) -> Future:
    """Futures that take the ways named, each (movement, [T, 2], heading), in turn."""
    movements = [route.movement for route in fit.ways.routes]
    turn = [ways[k % len(ways)] for k in range(SIZE)]
    return Future(
        np.stack([xy for _, xy, _ in turn]),
        np.stack([np.full(TICKS, heading) for _, _, heading in turn]),
        np.ones((SIZE, TICKS), dtype=np.bool_), np.full(SIZE, 9.0),
        np.zeros(SIZE, dtype=np.bool_), np.zeros(SIZE, dtype=np.bool_),
        np.array([movements.index(name) for name, _, _ in turn]), np.full(SIZE, 1 / SIZE),
        np.full(SIZE, np.inf),
    )  # fmt: skip


T = DT * np.arange(TICKS)
SOUTH = np.stack([0 * T, 30.0 - 5.0 * T], axis=-1)
EAST = np.stack([-30.0 + 5.0 * T, 0 * T], axis=-1)
AWAY = np.stack([300.0 + 5.0 * T, 0 * T], axis=-1)


@pytest.fixture(scope="module")
def outlook() -> Outlook:
    """`a` goes straight on or left; on its way straight it meets `b`, who surely goes east.

    `c` is far from everybody.
    """
    agents = tuple(driver(name) for name in "abc")
    fits = tuple(fit_of(agent) for agent in agents)
    futures = (
        future(fits[0], [("straight", SOUTH, -np.pi / 2), ("left", AWAY, 0.0)]),
        future(fits[1], [("straight", EAST, 0.0)]),
        future(fits[2], [("straight", AWAY + 500.0, 0.0)]),
    )
    return Outlook(agents, fits, futures, futures, np.zeros(3))


def test_what_takes_an_agent_close_to_others_is_less_likely(outlook: Outlook) -> None:
    company = company_of(outlook)
    meets = np.arange(SIZE) % 2 == 0
    assert np.abs(company.free[0, 1].gap[meets]).max() < 1.0
    seen_by_c = company.clear[0, 2]
    assert seen_by_c.sum() == pytest.approx(1.0)
    assert seen_by_c[meets].sum() < 0.2


def test_what_two_have_to_do_with_one_another_stays_open(outlook: Outlook) -> None:
    company = company_of(outlook)
    assert company.clear[0, 1] == pytest.approx(np.full(SIZE, 1 / SIZE))


def test_a_pair_is_told_by_its_likeliest_meeting(outlook: Outlook) -> None:
    (pair,) = pairs_of(outlook, window=4.0)
    told = dict(zip(NAMES, pair.values.tolist(), strict=True))
    assert (pair.a, pair.b) == ("a", "b")
    assert told["best"] == 1.0
    assert told["best_share"] == pytest.approx(0.5)
    assert told["within_1"] == pytest.approx(0.5)
    assert told["soon"] == pytest.approx(6.0, abs=1.0)
    assert told["angle"] == pytest.approx(np.pi / 2)
    assert told["own_a"] == pytest.approx(0.5)
    assert told["own_b"] == pytest.approx(1.0)
    assert told["zone_a"] == pytest.approx(30.0 - (4.6 + 1.85) / 2, abs=1.0)
    assert told["offset"] < 0.2
    back = dict(zip(NAMES, mirrored(pair.values).tolist(), strict=True))
    assert back["own_b"] == told["own_a"]
    assert back["best"] == told["best"]
