"""Ranges of a plan as an OpenSCENARIO parameter value distribution, for what a scenario declares.

A scenario in routes has one factor for all speeds of an agent; a plan has speeds, which are the
highest that are kept for a second. So what a plan leaves open is divided by that speed.
"""

from __future__ import annotations

from itertools import pairwise
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.plan_file import LogicalPlan
from scenewright.scene.spread import Spread
from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.formats.openscenario import build_header, name_parameter
from scenewright.tools.formats.xml import add, write_bytes

RUNS = 100
"""Test runs that the file asks for."""
_BINS = 20
"""Of a lognormal distribution, which OpenSCENARIO 1.2 does not have; each is as likely."""


def write_ranges(scene: ExportedScene, plan: LogicalPlan) -> dict[str, bytes]:
    """The file of distributions that belongs to a scene's scenario in routes.

    Raises:
        InputError: the plan leaves no speed open of an agent of the scene's foreground.
    """
    root = build_header(scene)
    held = add(root, "ParameterValueDistribution")
    add(held, "ScenarioFile", filepath=f"{scene.name}.xosc")
    drawn = add(held, "Stochastic", numberOfTestRuns=RUNS, randomSeed=scene.record.meta.seed)
    agents = {each.name: each for each in scene.agents if each.role == "foreground"}
    for (section, *at), spread in plan.spreads.items():
        if section != "measures" or at[1] != "value":
            continue
        measure = plan.data[section][at[0]]
        agent = agents.get(measure.get("agent"))
        if measure.get("kind") == "speed" and agent is not None:
            name = name_parameter("speed", agent)
            _add_spread(
                add(drawn, "StochasticDistribution", parameterName=name), spread, _measure(agent)
            )
    if not len(drawn):
        raise InputError(
            f"{plan.name} leaves no speed open of an agent that {scene.name} declares a parameter "
            "of; such a field is `measures: [{kind: speed, agent: vehicle-1, value: 4 .. 8 m/s}]`"
        )
    return {f"{scene.name}.parameters.xosc": write_bytes(root)}


def _measure(agent: ExportedAgent) -> float:
    """The highest speed that an agent keeps for a second, or has on a shorter track [m/s]."""
    window = min(round(1.0 / agent.step), len(agent.speed))
    kept = np.lib.stride_tricks.sliding_window_view(agent.speed, window).min(axis=1)
    return max(float(kept.max()), 0.1)


def _add_spread(parent: ElementTree.Element, spread: Spread, unit: float) -> None:
    """The distribution of a factor: the values of a plan in this unit."""
    ends = [round(spread.compute_value(share) / unit, 6) for share in np.linspace(0, 1, _BINS + 1)]
    match spread.kind:
        case "list":
            of = add(parent, "ProbabilityDistributionSet")
            for value in spread.values:
                add(of, "Element", value=round(value / unit, 6), weight=1.0)
        case "range":
            add(add(parent, "UniformDistribution"), "Range", lowerLimit=ends[0],
                upperLimit=ends[-1])  # fmt: skip
        case "normal":
            mean, deviation = (float(value) / unit for value in spread.values)
            of = add(parent, "NormalDistribution", expectedValue=round(mean, 6),
                     variance=round(deviation**2, 6))  # fmt: skip
            add(of, "Range", lowerLimit=ends[0], upperLimit=ends[-1])
        case "lognormal":
            of = add(parent, "Histogram")
            for low, high in pairwise(ends):
                add(add(of, "Bin", weight=1.0), "Range", lowerLimit=low, upperLimit=high)
