"""What a drive was like: encounters, collisions by fault, rules of the road, comfort, scores."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from scenewright.driving.driven_scene import DrivenScene, build_driven_scene
from scenewright.driving.resolve import Resolve
from scenewright.driving.scenario import COLOURS, KINDS, BoolArray, Scenario
from scenewright.driving.scores import (
    LANE_OFFSET,
    ScoreInputs,
    measure_comfort,
    score_epdms,
    score_nuplan,
)
from scenewright.driving.single_drive import Drive
from scenewright.driving.world import World, list_ego_points
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import Shape, Track
from scenewright.tools.relation_checker import (
    RoadUser,
    Trajectory,
    build_trajectories,
    compute_path_ttc,
    compute_ttc_2d,
    find_common_times,
    find_encounters,
    find_first_contact,
    measure_impact,
)

EXPOSED_TTC = 3.0
"""A path TTC below this [s] makes an ego react (SEMANTICS section 8)."""
EXPOSED_PET = 1.5
"""So does a PET below this [s]."""
STANDING = 0.05
"""nuPlan: slower than this [m/s] an agent is stopped."""
CRAWLING = 0.005
"""nuPlan: a slower ego [m/s] has no TTC."""
AHEAD, BESIDE = np.deg2rad([30.0, 150.0])
"""nuPlan: off the way ahead within which an agent counts for the TTC [rad]."""
REAR_AXLE = 0.3
"""From there these are seen: so far behind the middle, as a share of the length."""
APPROACH = 5.0
"""Before an impact, over which the approach speed is looked for [s]."""
FAR = 60.0
"""Agents that never come nearer than this are not looked at [m]."""

_FINDINGS = {
    "asked encounters": "missing", "unasked events": "interference",
    "hardness of motion": "implausible", "red lights": "signal_violations",
}  # fmt: skip
"""What keeps a driven scene from being verified, in words, and the findings of the proof."""


@dataclass(frozen=True)
class EgoCollision:
    """A collision of the ego.

    Attributes:
        other: name of what it hit; time: [s]; kind: nuPlan's class of collisions.
        at_fault: who should have prevented it, `ego` or `other`; reason: why.
        side: of the ego that was touched first; speed, other_speed: at the contact [m/s].
        approach_speed: largest of the ego in the 5 s before; reduction: by which it was less at
            the contact [m/s].
    """

    other: str
    time: float
    kind: str
    at_fault: str
    reason: str
    side: str | None
    speed: float
    other_speed: float
    approach_speed: float
    reduction: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {k: round(v, 3) if isinstance(v, float) else v for k, v in vars(self).items()}


@dataclass(frozen=True, eq=False)
class Report:
    """A drive and everything measured in it.

    Attributes:
        drive: the run; scene: what was driven with its proof; None on recorded tracks.
        impact: the ego's collision, if any.
        figures: everything else, as `to_json` writes it.
    """

    drive: Drive
    scene: DrivenScene | None
    impact: EgoCollision | None
    figures: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """The report as plain values (docs/driving.md lists the keys)."""
        drive, world = self.drive, self.drive.world
        return {
            "policy": drive.policy, "others": drive.others, "temperament": drive.temperament,
            "seed": drive.seed,
            "ego": drive.scenario.names[drive.scenario.ego],
            "end": world.end, "policy_fault": drive.fault,
            "time": round(world.step * drive.scenario.step, 3),
            "collision": None if self.impact is None else self.impact.to_json(),
            **self.figures,
        }  # fmt: skip


def report_drive(drive: Drive) -> Report:
    """Measure a drive."""
    world, scenario = drive.world, drive.scenario
    tracks = _build_tracks(drive)
    ego = tracks[0]
    near = _list_near(tracks)
    ttc = [
        compute_path_ttc(ego, track, times=find_common_times(ego, track)) for track in near.values()
    ]
    red = _count_red_lights(world)
    impact = _describe_impact(drive, ego, near, red=red)
    scene = build_driven_scene(drive) if scenario.record is not None else None
    least = min((float(each.min()) for each in ttc if len(each)), default=np.inf)
    pets = [met.pet for track in near.values() for met in find_encounters((ego, track))]
    pet = round(float(min(pets)), 3) if pets else None
    given = _gather(drive, ego, near, impact, red)
    figures = {
        "min_ttc": round(least, 3) if np.isfinite(least) else None,
        "min_pet": pet,
        "exposed": bool(least < EXPOSED_TTC) or (pet is not None and pet < EXPOSED_PET),
        "red_lights": red,
        "progress": round(given.progress, 3),
        "route_share": round(
            world.ego.progress / max(scenario.paths[scenario.ego].length, 1e-9), 4
        ),
        "off_road": round(given.off_road, 3),
        "comfort": measure_comfort(list_ego_points(world.history), scenario.step).to_json(),
        "nuplan": _score(drive, score_nuplan(given)),
        "epdms": _score(drive, score_epdms(given)),
        **({} if scene is None else _describe_scene(drive, scene)),
        **({} if drive.tries is None else {"tries": drive.tries}),
        "digest": drive.digest,
    }
    return Report(drive, scene, impact, figures)


def _score(drive: Drive, scores: dict[str, float]) -> dict[str, float]:
    """Scores of a drive; a policy that failed has none, however well it went until then."""
    return scores if drive.fault is None else scores | {"score": 0.0}


# ---- tracks -------------------------------------------------------------------------------------


def _build_tracks(drive: Drive) -> tuple[Trajectory, ...]:
    """List the ego's track, then all others, each the longest stretch in the scene."""
    scenario, world = drive.scenario, drive.world
    points = list_ego_points(world.history)
    users = [_make_user(scenario, scenario.ego, points[:, :2], points[:, 2], scenario.start)]
    for k in np.flatnonzero(np.arange(len(scenario.names)) != scenario.ego):
        there = np.array([now.present[k] for now in world.record])
        steps = np.flatnonzero(there)
        if len(steps) < 2:
            continue
        xy = np.array([now.xy[k] for now in world.record])[steps[0] : steps[-1] + 1]
        heading = np.array([now.heading[k] for now in world.record])[steps[0] : steps[-1] + 1]
        users.append(_make_user(scenario, int(k), xy, heading, scenario.start + int(steps[0])))
    return build_trajectories(users)


def _make_user(
    scenario: Scenario, k: int, xy: FloatArray, heading: FloatArray, first: int
) -> RoadUser:
    kind = KINDS[int(scenario.kinds[k])]
    shape_type: AgentClass = "vehicle" if kind == "object" else kind  # type: ignore[assignment]
    shape = Shape(shape_type, float(scenario.sizes[k, 0]), float(scenario.sizes[k, 1]))
    track = Track(
        xy.round(3), np.unwrap(heading).round(4), round(first * scenario.step, 3), scenario.step
    )
    return RoadUser(k + 1, track, shape)


def _list_near(tracks: tuple[Trajectory, ...]) -> dict[int, Trajectory]:
    """By index those that come near the ego."""
    ego = tracks[0]
    found = {}
    for track in tracks[1:]:
        times = find_common_times(ego, track)
        if len(times) and np.hypot(*(ego.at(times)[0] - track.at(times)[0]).T).min() < FAR:
            found[track.id - 1] = track
    return found


# ---- fault --------------------------------------------------------------------------------------


def _describe_impact(
    drive: Drive, ego: Trajectory, near: dict[int, Trajectory], *, red: int
) -> EgoCollision | None:
    """Measure the ego's collision and find the agent at fault."""
    world, scenario = drive.world, drive.scenario
    if world.hit is None or world.hit not in near:
        return None
    other = near[world.hit]
    contact = find_first_contact(ego, other)
    time = contact.time if contact is not None else world.step * scenario.step
    seen = measure_impact(ego, other, time=time)
    kind = _classify(seen.speeds, seen.sides)
    fault, reason = _find_fault(scenario, world.hit, kind, red=red)
    before = ego.speed[
        ego.find_indices(np.arange(max(time - APPROACH, ego.start), time, scenario.step))
    ]
    approach = float(before.max()) if len(before) else seen.speeds[0]
    return EgoCollision(
        scenario.names[world.hit], float(time), kind, fault, reason, seen.sides[0], seen.speeds[0],
        seen.speeds[1], approach, max(approach - seen.speeds[0], 0.0),
    )  # fmt: skip


def _classify(speeds: tuple[float, float], sides: tuple[Any, Any]) -> str:
    """nuPlan's classes of collisions."""
    if speeds[0] <= STANDING:
        return "stopped_ego"
    if speeds[1] <= STANDING:
        return "stopped_track"
    if sides[0] == "front":
        return "active_front"
    return "active_rear" if sides[0] == "rear" else "active_lateral"


def _find_fault(scenario: Scenario, hit: int, kind: str, *, red: int) -> tuple[str, str]:
    """Who should have prevented a collision: right of way first, then the side that was hit."""
    if kind == "stopped_ego":
        return "other", "the ego stood"
    if scenario.violators[hit]:
        return "other", "the other ran a red light"
    if red:
        return "ego", "the ego ran a red light"
    if kind == "active_rear":
        return "other", "the ego was hit from behind"
    if scenario.priority[hit]:
        return "ego", "the other had the right of way"
    if kind in ("stopped_track", "active_front"):
        return "ego", "the ego's front hit the other"
    return "other", "the other drove into the ego's side"


# ---- rules of the road --------------------------------------------------------------------------


def _count_red_lights(world: World) -> int:
    """Lights that the ego's centre line passed on red."""
    scenario = world.scenario
    count = 0
    progress = np.array([state.progress for state in world.history])
    for light, s in scenario.paths[scenario.ego].stops:
        passed = np.flatnonzero((progress[:-1] <= s + 0.5) & (progress[1:] > s + 0.5))
        steps = [scenario.start + int(k) + 1 for k in passed]
        count += any(scenario.get_colour(light, step) == COLOURS.index("red") for step in steps)
    return count


def _gather(
    drive: Drive, ego: Trajectory, near: dict[int, Trajectory], impact: EgoCollision | None,
    red: int,
) -> ScoreInputs:  # fmt: skip
    scenario, world = drive.scenario, drive.world
    points = list_ego_points(world.history)
    at_fault = impact is not None and impact.at_fault == "ego"
    is_object = world.hit is not None and KINDS[int(scenario.kinds[world.hit])] == "object"
    lawful = _find_lawful_progress(scenario)
    return ScoreInputs(
        at_fault=int(at_fault and not is_object),
        at_fault_objects=int(at_fault and is_object),
        off_road=_measure_off_road(scenario, points),
        against_flow=_measure_against_flow(scenario, points),
        red_lights=red,
        ttc=_find_ttc(world, ego, near),
        progress=world.history[-1].progress - world.history[0].progress,
        reference=float(lawful[min(world.step, len(lawful) - 1)] - lawful[scenario.start]),
        overspeed=float(np.maximum(points[:, 3] - scenario.speed_limit, 0.0).sum() * scenario.step),
        duration=scenario.step * (len(points) - 1),
        off_lane=_find_longest_off_lane(world),
        comfortable=measure_comfort(points, scenario.step).is_comfortable,
    )


def _find_lawful_progress(scenario: Scenario) -> FloatArray:
    """[T] way of the recorded ego, held at lights that it ran on red until they change [m]."""
    path = scenario.paths[scenario.ego]
    progress = path.progress
    for light, s in path.stops:
        step = int(np.searchsorted(progress, s + 0.5, side="right"))
        if step < len(progress) and scenario.get_colour(light, step) == COLOURS.index("red"):
            changed = np.flatnonzero(scenario.colours[light, step:] != COLOURS.index("red"))
            wait = int(changed[0]) if len(changed) else len(progress)
            held = np.concatenate(
                [progress[:step], np.full(wait, min(s, progress[step])), progress[step:]]
            )
            progress = held[: len(path.progress)]
    return progress


def _measure_off_road(scenario: Scenario, points: FloatArray) -> float:
    """Largest distance of a corner of the ego outside of the drivable area [m]; 0 without a map."""
    if scenario.intersection_map is None:
        return 0.0
    import shapely

    geos: Any = shapely
    road = geos.union_all([
        geos.Polygon(area.exterior, [list(hole) for hole in area.holes])
        for area in scenario.intersection_map.road
    ])  # fmt: skip
    extent = scenario.intersection_map.extent
    c, s = np.cos(points[:, 2]), np.sin(points[:, 2])
    length, width = scenario.sizes[scenario.ego]
    ahead, left = np.stack([c, s]) * length / 2, np.stack([-s, c]) * width / 2
    sides = ((1, 1), (1, -1), (-1, -1), (-1, 1))
    corners = np.concatenate([points[:, :2] + (a * ahead + b * left).T for a, b in sides])
    corners = corners[(np.abs(corners) <= extent).all(axis=1)]
    if not len(corners):
        return 0.0
    return float(geos.distance(road, geos.points(corners)).max())


def _measure_against_flow(scenario: Scenario, points: FloatArray) -> float:
    """Longest way within 1 s that the ego's centre went against every lane under it [m]."""
    lanes = scenario.map_lines[scenario.map_kinds == 0]
    if not len(lanes):
        return 0.0
    legs = np.diff(lanes, axis=1)
    middle = (lanes[:, 1:] + lanes[:, :-1]) / 2
    course = np.arctan2(legs[..., 1], legs[..., 0])
    apart = np.hypot(*np.moveaxis(points[:, None, None, :2] - middle, -1, 0))
    half = np.hypot(*np.moveaxis(legs, -1, 0)) / 2
    under = apart <= half + 1.0
    along = np.cos(points[:, 2, None, None] - course)
    against = under.any(axis=(1, 2)) & ~(under & (along > 0)).any(axis=(1, 2))
    way = np.where(against, points[:, 3] * scenario.step, 0.0)
    window = round(1.0 / scenario.step)
    return float(np.convolve(way, np.ones(window), mode="same").max())


def _find_ttc(world: World, ego: Trajectory, near: dict[int, Trajectory]) -> float:
    """Least 2-D TTC of the moving ego with agents ahead, in a junction also beside it [s].

    nuPlan's sectors: agents count within 30 degrees of the way ahead of the rear axle, and within
    150 where the ego is in a junction or off its lane, or no map says where it is.
    """
    scenario, points = world.scenario, list_ego_points(world.history)
    ahead = np.stack([np.cos(points[:, 2]), np.sin(points[:, 2])], axis=1)
    axle = points[:, :2] - scenario.sizes[scenario.ego, 0] * REAR_AXLE * ahead
    wide = np.array([abs(state.offset) > LANE_OFFSET for state in world.history])
    widest = np.where(wide | _find_in_junction(scenario, axle), BESIDE, AHEAD)
    least = np.inf
    for track in near.values():
        times = find_common_times(ego, track)
        k = ego.find_indices(times)
        delta = track.at(times)[0] - axle[k]
        cosine = (delta * ahead[k]).sum(axis=1) / np.maximum(np.hypot(*delta.T), 1e-9)
        chosen = times[(cosine > np.cos(widest[k])) & (ego.speed[k] > CRAWLING)]
        if len(chosen):
            least = min(least, float(compute_ttc_2d(ego, track, times=chosen, horizon=1.0).min()))
    return least


def _find_in_junction(scenario: Scenario, xy: FloatArray) -> BoolArray:
    """[n] whether points lie on lanes inside the junction; without a map all may."""
    if scenario.intersection_map is None:
        return np.ones(len(xy), dtype=np.bool_)
    import shapely

    geos: Any = shapely
    inside = geos.union_all([
        geos.Polygon((*lane.left, *reversed(lane.right))).buffer(0)
        for lane in scenario.intersection_map.lanelets if lane.kind == "connector"
    ])  # fmt: skip
    return np.asarray(geos.contains_xy(inside, xy))


def _find_longest_off_lane(world: World) -> float:
    """Longest time more than 0.5 m beside the route [s]."""
    longest = run = 0
    for state in world.history:
        run = run + 1 if abs(state.offset) > LANE_OFFSET else 0
        longest = max(longest, run)
    return longest * world.scenario.step


# ---- the scene ----------------------------------------------------------------------------------


def _describe_scene(drive: Drive, scene: DrivenScene) -> dict[str, Any]:
    """The proof, the encounter that was asked for, and collisions that the ego had no part in."""
    scenario = drive.scenario
    ids = [agent.id for agent in scenario.record.agents]  # type: ignore[union-attr]
    me = ids[scenario.ego]
    meetings = drive.world.traffic.meetings if isinstance(drive.world.traffic, Resolve) else ()
    # those that were re-timed stand in for those that the ego was to meet
    partners = {
        ids[k] for k in (*scenario.partner, *(m.agent for m in meetings if m.agent != m.asked))
    }
    met = [e for e in scene.events if {e.from_, e.to} & {me} and {e.from_, e.to} & partners]
    apart = [e for e in scene.events if e.type == "collision" and me not in (e.from_, e.to)]
    return {
        **scene.proof.build_verdict(),
        "not_verified_for": [k for k, found in _FINDINGS.items() if getattr(scene.proof, found)],
        "as_asked": not scene.dropped and not scene.proof.missing,
        "encounter": [
            {"type": e.type, "with": scenario.names[ids.index(e.to if e.from_ == me else e.from_)],
             "time": round(e.time, 3)} for e in met
        ],
        "background_collisions": len(apart),
        **_describe_meetings(drive, {ids.index(n) for e in met for n in (e.from_, e.to)}),
        "events": [e.model_dump(mode="json", by_alias=True) for e in scene.events],
    }  # fmt: skip


def _describe_meetings(drive: Drive, met: set[int]) -> dict[str, Any]:
    """With re-timed others: whether each conflict came about, or when and why not."""
    traffic, names = drive.world.traffic, drive.scenario.names
    if not isinstance(traffic, Resolve):
        return {}
    rows = []
    for meeting in traffic.meetings:
        row: dict[str, Any] = {"with": names[meeting.asked], "came_about": meeting.agent in met}
        if meeting.agent != meeting.asked:
            row["stand_in"] = names[meeting.agent]
        if not row["came_about"]:
            time = drive.world.step * drive.scenario.step if meeting.time is None else meeting.time
            row |= {"time": round(time, 2), "reason": meeting.explain()}
        if row["with"] in drive.obstacles:
            obstacle = drive.obstacles[row["with"]]
            row |= {"allowed": obstacle is None, "obstacle": obstacle}
        rows.append(row)
    return {"resolved": rows}
