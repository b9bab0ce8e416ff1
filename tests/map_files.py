"""Small map files written by hand: junctions of straight streets at chosen bearings."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

ORIGIN = (48.0, 9.0)
_METRE = 1 / 111_195.0


def osm(file: Path, bearings, *, lanes=2, signals=True, names=None, second=False) -> Path:
    """OpenStreetMap: one junction of two-way streets, 220 m long, at bearings [degrees]."""
    lat, lon = ORIGIN
    squeeze = 1 / math.cos(math.radians(lat))
    nodes, ways = [], []
    centres = [(0.0, 0.0), (900.0, 0.0)] if second else [(0.0, 0.0)]
    for c, (x0, y0) in enumerate(centres):
        light = '<tag k="highway" v="traffic_signals"/>' if signals else ""
        nodes.append(
            f'<node id="{100 * c + 1}" lat="{lat + y0 * _METRE:.8f}" '
            f'lon="{lon + x0 * _METRE * squeeze:.8f}">{light}</node>'
        )
        for i, bearing in enumerate(bearings):
            ids = []
            for step, far in enumerate((110.0, 220.0)):
                x = x0 + far * math.cos(math.radians(bearing))
                y = y0 + far * math.sin(math.radians(bearing))
                name = 100 * c + 10 * (i + 1) + step
                ids.append(name)
                nodes.append(
                    f'<node id="{name}" lat="{lat + y * _METRE:.8f}" '
                    f'lon="{lon + x * _METRE * squeeze:.8f}"/>'
                )
            refs = "".join(f'<nd ref="{n}"/>' for n in (100 * c + 1, *ids))
            street = names[i] if names else f"Street {i + 1}"
            tags = {"highway": "secondary", "lanes": lanes, "maxspeed": 50, "name": street}
            text = "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.items())
            ways.append(f'<way id="{1000 + 100 * c + i}">{refs}{text}</way>')
    body = "".join(nodes) + "".join(ways)
    file.write_text(f'<?xml version="1.0"?><osm version="0.6">{body}</osm>', encoding="utf-8")
    return file


def sumo_net(
    file: Path, bearings, *, lanes=1, left_hand=False, kind="priority", crossings=False
) -> Path:
    """A SUMO network of straight streets, by netconvert; with sidewalks and crossings if wanted."""
    import sumo

    nodes = [f'<node id="J" x="0" y="0" type="{kind}"/>']
    edges = []
    for i, bearing in enumerate(bearings):
        x, y = (200 * f(math.radians(bearing)) for f in (math.cos, math.sin))
        nodes.append(f'<node id="n{i}" x="{x:.2f}" y="{y:.2f}"/>')
        for a, b in ((f"n{i}", "J"), ("J", f"n{i}")):
            edges.append(
                f'<edge id="{a}_{b}" from="{a}" to="{b}" numLanes="{lanes}" speed="13.9"/>'
            )
    plain = {"nod": ("nodes", nodes), "edg": ("edges", edges)}
    for name, (root, lines) in plain.items():
        text = f"<{root}>{''.join(lines)}</{root}>"
        file.with_suffix(f".{name}.xml").write_text(text, encoding="utf-8")
    command = [str(Path(sumo.SUMO_HOME) / "bin" / "netconvert"), "-o", str(file)]
    command += ["-n", str(file.with_suffix(".nod.xml")), "-e", str(file.with_suffix(".edg.xml"))]
    command += ["--no-turnarounds", "true", "--no-warnings", "true"]
    command += ["--lefthand", str(left_hand).lower()]
    if crossings:
        command += ["--sidewalks.guess", "true", "--sidewalks.guess.max-speed", "20"]
        command += ["--crossings.guess", "true", "--crossings.guess.speed-threshold", "20"]
    subprocess.run(command, check=True, capture_output=True)
    return file


def opendrive(file: Path, network: Path) -> Path:
    """The same network as OpenDRIVE."""
    import sumo

    command = [str(Path(sumo.SUMO_HOME) / "bin" / "netconvert"), "-s", str(network)]
    subprocess.run([*command, "--opendrive-output", str(file)], check=True, capture_output=True)
    return file


def lanelet2(file: Path, *, reverse=False, drop=(), scale=1.0) -> Path:
    """Four legs of one lane each way, straight and turning lanelets, a crosswalk in the north."""
    lat, lon = ORIGIN
    squeeze = 1 / math.cos(math.radians(lat))
    nodes, ways, relations = [], [], []

    def way(points) -> int:
        refs = []
        for x, y in points:
            name = len(nodes) + 1
            nodes.append(
                f'<node id="{name}" lat="{lat + scale * y * _METRE:.9f}" '
                f'lon="{lon + scale * x * _METRE * squeeze:.9f}"/>'
            )
            refs.append(f'<nd ref="{name}"/>')
        ways.append(f'<way id="{len(ways) + 5001}">{"".join(refs)}</way>')
        return len(ways) + 5000

    def lanelet(left, right, subtype="road") -> None:
        roles = (("left", way(left[::-1] if reverse else left)), ("right", way(right)))
        members = "".join(f'<member type="way" role="{r}" ref="{w}"/>' for r, w in roles
                          if r not in drop)  # fmt: skip
        tags = {"type": "lanelet", "subtype": subtype, "location": "urban", "speed_limit": "50"}
        text = "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.items())
        relations.append(f'<relation id="{9001 + len(relations)}">{members}{text}</relation>')

    def turned(points, quarter):
        for _ in range(quarter % 4):
            points = [(-y, x) for x, y in points]
        return points

    for q in range(4):  # leg towards the east, then turned
        lanelet(*(turned([(90.0, y), (12.0, y)], q) for y in (0.0, 3.5)))
        lanelet(*(turned([(12.0, y), (90.0, y)], q) for y in (0.0, -3.5)))
        lanelet(*(turned([(12.0, y), (-12.0, y)], q) for y in (0.0, 3.5)))
        for radius, sign in ((12.0, 1), (12.0, -1)):
            lanelet(*(turned(_arc(radius, sign, y), q) for y in (0.0, 3.5)))
    lanelet([(-4.0, 15.0), (4.0, 15.0)][::-1], [(-4.0, 18.0), (4.0, 18.0)][::-1], "crosswalk")
    body = "".join((*nodes, *ways, *relations))
    file.write_text(f'<?xml version="1.0"?><osm version="0.6">{body}</osm>', encoding="utf-8")
    return file


def _arc(radius, sign, y):
    """From the east leg, driving west, to the south (sign 1, left) or the north (sign -1)."""
    if sign > 0:  # round the corner at (12, -12)
        r = radius + y
        return [(12 - r * math.sin(a), -12 + r * math.cos(a)) for a in _quarter()]
    r = radius - y
    return [(12 - r * math.sin(a), 12 - r * math.cos(a)) for a in _quarter()]


def _quarter():
    return [math.pi / 2 * i / 12 for i in range(13)]
