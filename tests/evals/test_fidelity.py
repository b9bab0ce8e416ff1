"""S2R and dNLL: signs, sizes, and what is compared with what."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright import synthesize
from scenewright.evals.fidelity import compute_lines, format_markdown, main, weigh
from scenewright.evals.tables.likelihood import AgentScore


def agents(relation: str, nll: float, *, scene: int, role: str = "foreground") -> list[AgentScore]:
    return [
        AgentScore(scene + k, relation, role, "vehicle", {"drawn": nll}, nll - 1.0)
        for k in range(4)
    ]


def test_less_likely_than_normal_is_a_positive_difference_and_the_sign_of_s2r_follows_eq_8():
    normal = agents("normal", -10.0, scene=0, role="background")
    rows = {
        (r.relation, r.role): r
        for r in compute_lines([*normal, *agents("yielding", -8.0, scene=9)])
    }
    event = rows["yielding", "foreground"]
    assert event.gap is not None
    assert event.gap.delta == pytest.approx(0.2)  # 2 nats over ten waypoints
    assert event.gap.s2r == pytest.approx((-10.0 - -8.0) / -10.0)
    assert event.gap.delta_interval == pytest.approx((0.2, 0.2))
    assert event.of_route == pytest.approx(0.1)
    assert rows["normal", "background"].gap is None


def test_without_normal_scenes_only_the_own_route_is_compared():
    (row,) = compute_lines(agents("follow", -5.0, scene=0))
    assert row.gap is None
    assert "–" in format_markdown([row])


def test_agents_of_a_scene_are_weighed_by_their_routes():
    scene = synthesize("A car follows a bus, two background cars", seed=1, refiner="none").record
    found = list(weigh([scene]))
    assert {each.role for each in found} == {"foreground", "background"}
    assert {each.group for each in found} == {"follow"}
    assert np.isfinite([each.nll["drawn"] for each in found]).all()
    # Drawn from the prior itself, nobody is far off what its route leads to expect.
    assert all(abs(each.nll["drawn"] - each.expected) < 40 for each in found)


def test_a_folder_without_scenes_is_said_so(tmp_path, capsys):
    assert main([str(tmp_path)]) == 2
    assert "no scene.json" in capsys.readouterr().err
