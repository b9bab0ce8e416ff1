"""A scene rolled out under the guidance of its edited priors (paper 3.5, Eq. 7).

Each agent starts on the edited prior, is predicted together with the others, and heads for
places on its prior, each due at its time: segment goals, and waypoints evenly in between. The
result is expressed as a deviation from the prior in arc length along the agent's own path; the
kinematic layer moves it to the output step and keeps it feasible.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.geometry.polyline import interpolate_points
from scenewright.geometry.spline import interpolate_clamped
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.candidates import Path
from scenewright.scene.track import STEP, Track
from scenewright.tools.trajnet_refiner.config import CLASSES
from scenewright.tools.trajnet_refiner.network import RefinerNetwork
from scenewright.tools.trajnet_refiner.rollout import Waypoints, run_rollout

WARM_UP = 4.8
"""How long before the scene agents are rolled out that are mid-route at its beginning [s]."""
GIVEN = 3
"""Network steps at the beginning of a track that are the prior's: they say how it moves."""
SPACING = {"vehicle": 10, "pedestrian": 12}
"""Network steps from one waypoint to the next."""
LEAD, STRICT_LEAD = 5, {"vehicle": 3, "pedestrian": 5}
"""Network steps before a waypoint is due from which the next one counts: of vehicles that stop or
slow down for no relation, and of all others: a relation depends on when they are where, and who
drives on wavers less that way."""
_SLOW = 3.0
"""An agent never slower than this drives on [m/s]."""
BEFORE_STAND = 4.0
"""How long before it stands [s] a vehicle that nothing depends on heads for no waypoint but that
place: people brake gently first and harder at the end, each in their own way."""
TEMPERATURE = 0.3
"""Scale of what is drawn: the predicted Gaussian is wide for the few who do something sudden."""
_ASIDE = 12.0
"""No further from where the prior is [m] a position is looked for on the path."""


@dataclass(frozen=True, eq=False)
class Guide:
    """What is known of one agent before it is refined.

    Attributes:
        s: [T] arc length of the edited prior [m] every 0.1 s from `enters` on.
        enters: scene time of the first sample [s], a multiple of 0.1.
        kept: [T] where the prior stays as it is, but for the ripple of a vehicle's speed.
        steady: [T] where it stays exactly as it is; as `kept` if None.
        goals: scene times [s] at which it must be where the prior is.
        bound: a relation is about it.
    """

    kind: AgentClass
    path: Path
    s: FloatArray
    enters: float
    kept: NDArray[np.bool_]
    steady: NDArray[np.bool_] | None = None
    goals: tuple[float, ...] = ()
    bound: bool = False

    @property
    def lead(self) -> int:
        """Network steps before a waypoint is due from which the next one counts."""
        drives_on = bool((np.diff(self.s) > _SLOW * STEP).all())
        return STRICT_LEAD[self.kind] if self.bound or drives_on else LEAD

    @property
    def leaves(self) -> float:
        """Scene time of the last sample [s]."""
        return self.enters + STEP * (len(self.s) - 1)

    def is_within(self, duration: float) -> NDArray[np.bool_]:
        """[T] which samples lie in a scene of this length."""
        times = self.enters + STEP * np.arange(len(self.s))
        return np.asarray((times >= 0.0) & (times <= duration))

    def interpolate_prior(self, times: FloatArray) -> FloatArray:
        """Arc length [m] of the prior at scene times; NaN while it is not there."""
        local = STEP * np.arange(len(self.s))
        return np.interp(times - self.enters, local, self.s, left=np.nan, right=np.nan)


def compute_deviations(
    net: RefinerNetwork,
    guides: Mapping[str, Guide],
    *,
    duration: float,
    rng: np.random.Generator | None = None,
    fixed: Mapping[str, FloatArray] | None = None,
) -> dict[str, FloatArray]:
    """Compute how far ahead of its prior each agent gets, by name: [T] at its samples [m].

    Args:
        duration: of the scene [s].
        rng: of the drawn motion; the mean motion if None.
        fixed: [T] deviations of agents that are not predicted, but seen by the others.
    """
    if not guides:
        return {}
    step = net.config.step
    columns = int(np.ceil((duration + WARM_UP) / step)) + 1
    times = step * np.arange(columns, dtype=np.float64) - WARM_UP
    rows = list(guides.values())
    prior = np.stack([guide.interpolate_prior(times) for guide in rows])
    known = np.full_like(prior, np.nan)
    for n, guide in enumerate(rows):
        # Where it is given: at the beginning, and where the prior is kept.
        k = np.clip(np.rint((times - guide.enters) / STEP).astype(int), 0, len(guide.s) - 1)
        given = np.isfinite(prior[n]) & guide.kept[k]
        given[np.flatnonzero(np.isfinite(prior[n]))[:GIVEN]] = True
        known[n, given] = prior[n, given]
    for name, deviation in (fixed or {}).items():
        n = list(guides).index(name)
        local = STEP * np.arange(len(deviation))
        known[n] = prior[n] + np.interp(times - rows[n].enters, local, deviation)
    places = np.stack([_compute_places(guide.path, known[n]) for n, guide in enumerate(rows)])
    noise = None if rng is None else TEMPERATURE * rng.standard_normal((len(rows), columns, 2))
    rolled = _run_rollout(net, rows, places, prior, times, noise)
    result = {}
    for n, (name, guide) in enumerate(guides.items()):
        ahead = _compute_progress(guide.path, rolled[n], prior[n]) - prior[n]
        ahead = np.where(np.isfinite(known[n]), known[n] - prior[n], ahead)
        result[name] = _interpolate_deviations(guide, times, ahead)
    return result


def compute_deviation(guide: Guide, track: Track) -> FloatArray:
    """Compute how far ahead of its prior an agent's track is [m]; 0 where there is none."""
    deviation = np.zeros(len(guide.s))
    k = np.rint((track.times - guide.enters) / STEP).astype(int)
    inside = (k >= 0) & (k < len(guide.s))
    prior = guide.s[k[inside]]
    deviation[k[inside]] = _compute_progress(guide.path, track.xy[inside], prior) - prior
    return deviation


def _compute_places(path: Path, s: FloatArray) -> FloatArray:
    """[T, 2] positions of arc lengths; NaN for NaN."""
    at = np.nan_to_num(s)
    return np.where(np.isfinite(s)[:, None], interpolate_points(at, path.s, path.xy), np.nan)


def _run_rollout(
    net: RefinerNetwork,
    rows: list[Guide],
    places: FloatArray,
    prior: FloatArray,
    times: FloatArray,
    noise: FloatArray | None,
) -> FloatArray:
    """Roll out positions [N, T, 2] of all agents at the network's steps."""
    there = np.isfinite(prior)
    until = np.where(there.any(axis=1), len(times) - np.argmax(there[:, ::-1], axis=1), 0)
    due = [_list_due_columns(guide, times, there[n]) for n, guide in enumerate(rows)]
    most = max(1, *(len(each) for each in due))
    goals = np.full((len(rows), most, 2), np.nan)
    when = np.full((len(rows), most), np.nan)
    for n, columns in enumerate(due):
        at = rows[n].interpolate_prior(times[0] + (times[1] - times[0]) * columns)
        goals[n, : len(columns)] = _compute_places(rows[n].path, at)
        when[n, : len(columns)] = columns
    classes = np.array([CLASSES.index(guide.kind) for guide in rows])
    return run_rollout(
        net,
        places,
        classes=classes,
        waypoints=Waypoints(goals, when),
        until=until,
        keep=net.config.stride,
        lead=np.array([guide.lead for guide in rows]),
        noise=noise,
    )


def _list_due_columns(guide: Guide, times: FloatArray, there: NDArray[np.bool_]) -> FloatArray:
    """Columns at which a waypoint is due: at every goal, where the prior is kept again, and evenly.

    Of the even ones, those just before it is kept again are left out if nothing depends on them.
    """
    step = float(times[1] - times[0])
    first = int(np.argmax(there))
    last = (guide.leaves - times[0]) / step
    even = np.arange(first + SPACING[guide.kind], last, SPACING[guide.kind], dtype=np.float64)
    onsets = np.flatnonzero(np.diff(guide.kept.astype(np.int8)) > 0) + 1
    again = guide.enters + STEP * onsets
    wanted = np.concatenate([again, np.array(guide.goals), [guide.leaves]])
    columns = np.floor((wanted - times[0]) / step + 1e-6)
    if guide.kind == "vehicle" and not guide.bound:
        early = columns[: len(again), None] - even
        even = even[~((early > 0.0) & (early < BEFORE_STAND / step)).any(axis=0)]
    every = np.unique(np.concatenate([even, columns]))
    return np.asarray(every[(every > first) & (every <= last + 1e-6)])


def _compute_progress(path: Path, xy: FloatArray, near: FloatArray) -> FloatArray:
    """[T] arc length of the place on the path nearest to each position, not far from `near`.

    Beyond its end the path goes straight on: an agent ahead of its prior leaves sooner, not slower.
    """
    return _find_progress(np.ascontiguousarray(xy), near, path.s, path.xy, path.heading)


@compiled
def _find_progress(
    xy: FloatArray, near: FloatArray, s: FloatArray, nodes: FloatArray, heading: FloatArray
) -> FloatArray:
    progress, spacing = np.full(len(xy), np.nan), s[1] - s[0]
    for t in range(len(xy)):
        if np.isnan(xy[t, 0]) or np.isnan(near[t]):
            continue
        k, least = 0, np.inf
        for n in range(len(s)):
            dx, dy = xy[t, 0] - nodes[n, 0], xy[t, 1] - nodes[n, 1]
            if abs(s[n] - near[t]) <= _ASIDE and dx * dx + dy * dy < least:
                k, least = n, dx * dx + dy * dy
        dx, dy = xy[t, 0] - nodes[k, 0], xy[t, 1] - nodes[k, 1]
        along = max(dx * np.cos(heading[k]) + dy * np.sin(heading[k]), -spacing)
        progress[t] = max(s[k] + (along if k == len(s) - 1 else min(along, spacing)), 0.0)
    return progress


def _interpolate_deviations(guide: Guide, times: FloatArray, ahead: FloatArray) -> FloatArray:
    """[T] deviations at the network's steps brought to 0.1 s by a spline of smooth acceleration."""
    fine = np.zeros(len(guide.s))
    seen = np.flatnonzero(np.isfinite(ahead))
    if len(seen) < 2:
        return fine
    local = guide.enters + STEP * np.arange(len(guide.s))
    inside = (local >= times[seen[0]]) & (local <= times[seen[-1]])
    fine[inside] = interpolate_clamped(local[inside], times[seen], ahead[seen])
    return fine


_SPREAD, _VARIES = 0.19, 0.3
"""Of the progress [m]: median over drivers, and how it varies between them [log]; the speed has
0.15 m/s, the acceleration 0.2 m/s^2."""
_MOST = 0.35
_LASTS = 1.28
"""Its autocorrelation is that of a Gaussian with this standard deviation [s]."""
_FULL = 4.0
"""Below this speed [m/s] it is less, in proportion."""


def draw_ripple(s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """[T] how far ahead of its progress `s` [T] every 0.1 s a vehicle is [m]."""
    steps = _LASTS / STEP
    reach = round(3 * steps)
    # A kernel narrower by the root of 2 than the autocorrelation that it brings about.
    kernel = np.exp(-np.square(np.arange(-reach, reach + 1) / steps))
    kernel /= np.sqrt(np.square(kernel).sum())
    own = min(_SPREAD * float(np.exp(_VARIES * rng.standard_normal())), _MOST)
    drawn = np.convolve(rng.standard_normal(len(s) + 2 * reach), kernel, mode="valid")
    speed = np.gradient(s, STEP) if len(s) > 1 else np.zeros(len(s))
    even = np.convolve(np.pad(speed, 10, mode="edge"), np.ones(21) / 21, mode="valid")
    return np.asarray(own * drawn * np.clip(even / _FULL, 0.0, 1.0))
