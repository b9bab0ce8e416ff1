"""Traffic at a crossroads by SUMO, with what its SSM device says about it.

Two one-way roads cross at a right angle; lanes are as wide as the vehicles, so that SUMO's zone of
conflict (where lanes overlap) is the overlap of the swept paths. Some drivers ignore others, so
that there are collisions too, and some are slow, so that others close in from behind.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from importlib.metadata import version
from pathlib import Path
from typing import Any

import sumo

LENGTH, WIDTH, STEP = 4.6, 1.85, 0.1
NODES = """<nodes>
  <node id="w" x="-200" y="0"/><node id="e" x="200" y="0"/>
  <node id="s" x="0" y="-200"/><node id="n" x="0" y="200"/>
  <node id="c" x="0" y="0" type="priority"/>
</nodes>"""
KIND = f'numLanes="1" speed="13.9" width="{WIDTH}" spreadType="center"'
EDGES = f"""<edges>
  <edge id="wc" from="w" to="c" priority="2" {KIND}/>
  <edge id="ce" from="c" to="e" priority="2" {KIND}/>
  <edge id="sc" from="s" to="c" priority="1" {KIND}/>
  <edge id="cn" from="c" to="n" priority="1" {KIND}/>
</edges>"""
CONNECTIONS = """<connections>
  <connection from="wc" to="ce"/><connection from="sc" to="cn"/>
</connections>"""


def routes(seconds: float, rude: float) -> str:
    """Some slow, some in a hurry; those of the minor road are rude with a probability."""
    kind = f'length="{LENGTH}" width="{WIDTH}" minGap="1.0" sigma="0.4" speedDev="0.15"'
    flow = f'begin="0" end="{seconds}" departSpeed="max" departPos="base"'
    return f"""<routes>
  <vType id="calm" {kind} tau="0.4" decel="8"/>
  <vType id="slow" {kind} maxSpeed="6"/>
  <vType id="rude" {kind} jmIgnoreFoeProb="{rude}" jmIgnoreFoeSpeed="30"
         jmIgnoreJunctionFoeProb="{rude}"/>
  <route id="we" edges="wc ce"/><route id="sn" edges="sc cn"/>
  <flow id="a" type="calm" route="we" probability="0.16" {flow}/>
  <flow id="c" type="slow" route="we" probability="0.02" {flow}/>
  <flow id="b" type="rude" route="sn" probability="0.10" {flow}/>
</routes>"""


def simulate(folder: Path, request: dict[str, Any]) -> None:
    """Builds the network and runs SUMO in a folder."""
    binaries = Path(sumo.SUMO_HOME) / "bin"
    environment = os.environ | {"SUMO_HOME": str(sumo.SUMO_HOME)}
    files = {
        "n.nod.xml": NODES, "e.edg.xml": EDGES, "c.con.xml": CONNECTIONS,
        "r.rou.xml": routes(request["seconds"], request["rude"]),
    }  # fmt: skip
    for name, text in files.items():
        (folder / name).write_text(text)
    build = ["-n", "n.nod.xml", "-e", "e.edg.xml", "-x", "c.con.xml", "-o", "c.net.xml"]
    build += ["--default.junctions.radius", "3", "--no-turnarounds"]
    drive = ["-n", "c.net.xml", "-r", "r.rou.xml", "--step-length", str(STEP),
             "--seed", str(request["seed"]), "--end", str(request["seconds"]),
             "--precision", "4", "--fcd-output", "fcd.xml", "--no-step-log", "--no-warnings",
             "--device.ssm.probability", "1", "--device.ssm.measures", "TTC DRAC PET",
             "--device.ssm.thresholds", "5.0 0.0 8.0", "--device.ssm.range", "80",
             "--device.ssm.extratime", "8.0", "--device.ssm.trajectories", "true",
             "--device.ssm.file", "ssm.xml",
             "--collision.check-junctions", "true", "--collision.mingap-factor", "0",
             "--collision.action", "warn"]  # fmt: skip
    for program, arguments in (("netconvert", build), ("sumo", drive)):
        subprocess.run([str(binaries / program), *arguments], cwd=folder, env=environment,
                       check=True, stdout=subprocess.DEVNULL)  # fmt: skip


def tracks(file: Path) -> list[dict[str, Any]]:
    """The vehicles' centres; SUMO writes the middle of the front bumper."""
    agents: dict[str, dict[str, Any]] = {}
    for step in ET.parse(file).getroot():
        for row in step:
            heading = math.radians(90.0 - float(row.attrib["angle"]))
            agent = agents.setdefault(row.attrib["id"], {
                "name": row.attrib["id"], "class": "vehicle", "length": LENGTH, "width": WIDTH,
                "start": float(step.attrib["time"]), "step": STEP, "x": [], "y": [], "heading": [],
                "speed": [],
            })  # fmt: skip
            agent["x"].append(float(row.attrib["x"]) - LENGTH / 2 * math.cos(heading))
            agent["y"].append(float(row.attrib["y"]) - LENGTH / 2 * math.sin(heading))
            agent["heading"].append(heading)
            agent["speed"].append(float(row.attrib["speed"]))
    return list(agents.values())


def conflicts(file: Path) -> list[dict[str, Any]]:
    """What the SSM device reports of each pair: TTC, DRAC and kind by time, and PET."""
    found = []
    for row in ET.parse(file).getroot().iter("conflict"):
        values = {child.tag: child.attrib for child in row}
        spans = {tag: values[tag]["values"].split() for tag in
                 ("timeSpan", "typeSpan", "TTCSpan", "DRACSpan") if tag in values}  # fmt: skip
        pet = values.get("PET", {})
        found.append({
            "ego": row.attrib["ego"], "foe": row.attrib["foe"],
            "times": [float(v) for v in spans["timeSpan"]],
            "kinds": [int(v) for v in spans["typeSpan"]],
            "ttc": [_number(v) for v in spans.get("TTCSpan", [])],
            "drac": [_number(v) for v in spans.get("DRACSpan", [])],
            "pet": _number(pet.get("value", "NA")),
            "pet_kind": int(_number(pet.get("type", "NA")) or 0),
        })  # fmt: skip
    return found


def _number(text: str) -> float | None:
    return None if text == "NA" else float(text)


def main() -> None:
    request = json.load(sys.stdin)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        simulate(folder, request)
        answer = {
            "version": version("eclipse-sumo"), "agents": tracks(folder / "fcd.xml"),
            "conflicts": conflicts(folder / "ssm.xml"),
        }  # fmt: skip
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
