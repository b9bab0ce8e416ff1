"""SUMO floating car data (FCD): per time step every vehicle's front and every person.

Angles run clockwise from north in degrees. `length` and `width` are attributes of our own, which
SUMO's tools ignore.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np

from scenewright.tools.exporters.exported_scene import ExportedScene
from scenewright.tools.exporters.xml_writing import add, write_bytes


def write_fcd(scene: ExportedScene) -> dict[str, bytes]:
    """One `timestep` per 0.1 s, vehicles before persons as SUMO's schema wants them."""
    agents = sorted(scene.agents, key=lambda each: not each.names.is_vehicle)
    root = ElementTree.Element("fcd-export")
    for k, time in enumerate(scene.times.tolist()):
        step = add(root, "timestep", time=f"{time:.2f}")
        for agent in agents:
            if not agent.first <= k <= agent.last:
                continue
            n, vehicle = k - agent.first, agent.names.is_vehicle
            turn = float(agent.heading[n])
            forward = agent.length / 2 * vehicle
            x, y = (agent.xy[n] + forward * np.array([math.cos(turn), math.sin(turn)])).tolist()
            add(
                step, "vehicle" if vehicle else "person", id=agent.name,
                x=round(x, 4), y=round(y, 4), angle=round(90.0 - math.degrees(turn), 4) % 360.0,
                type=agent.names.sumo, speed=round(float(agent.speed[n]), 3),
                length=agent.length, width=agent.width,
            )  # fmt: skip
    return {f"{scene.name}.fcd.xml": write_bytes(root)}
