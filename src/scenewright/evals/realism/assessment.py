"""Assess data sets against real tracks: every measure of realism in one report.

`scenewright evals realism SET... --real NAME=PATH...` prints it. What is measured is in
`two_sample`, `street_measures` and `likelihood`; what is read in `sources`.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations, product
from typing import Any

import numpy as np

from scenewright.dataset.tables.markdown import format_table
from scenewright.evals.bootstrap import Figure
from scenewright.evals.realism.likelihood import FEATURES, measure_features, score_likelihood
from scenewright.evals.realism.sources import TrackSource
from scenewright.evals.realism.street_measures import (
    MEASURES,
    compute_count_ranks,
    compute_share,
    find_reactions,
)
from scenewright.evals.realism.two_sample import (
    MotionWindow,
    compare_windows,
    cut_windows,
    find_constant_speed,
    split_halves,
)
from scenewright.evals.records import format_records
from scenewright.geometry.kinematics import smooth
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker import RoadUser

_STANDS = 0.15
"""Slower than this [m/s], smoothed over `_SMOOTHED`, is standing."""
_SMOOTHED = 1.0
"""Standard deviation of the Gaussian about which positions jitter [s]."""
_LEAST, _EDGE = 40, 10
"""Samples of a standstill that counts, and of either end of it that do not."""
_FEWEST = 20
"""Standstills from which on a jitter is measured."""
_LAGS = 10


@dataclass(frozen=True)
class TrackingJitter:
    """Of positions: standard deviation [m], and that of the Gaussian that makes it smooth [s]."""

    spread: float
    lasts: float


def measure_tracking_jitter(source: TrackSource) -> TrackingJitter | None:
    """Measure how positions of standing vehicles jitter; None with too few of them."""
    found = []
    for user in (user for stretch in source.stretches for user in stretch.users):
        if user.shape.type != "vehicle" or len(user.track.xy) < _LEAST:
            continue
        even = smooth(user.track.xy, _SMOOTHED)
        stands = np.hypot(*np.gradient(even, STEP, axis=0).T) < _STANDS
        edges = np.flatnonzero(np.diff(np.concatenate(([False], stands, [False]))))
        for first, last in edges.reshape(-1, 2).tolist():
            if last - first >= _LEAST:
                inside = slice(first + _EDGE, last - _EDGE)
                away = user.track.xy[inside] - even[inside]
                away, n = away - away.mean(axis=0), len(away)
                # The mean autocovariance of both coordinates [m^2], by lag.
                found.append([(away[: n - k] * away[k:]).mean() for k in range(_LAGS)])
    if len(found) < _FEWEST:
        return None
    middle = np.median(found, axis=0)
    if middle[0] <= 0.0:
        return None
    below = np.flatnonzero(middle < 0.5 * middle[0])
    half = STEP * float(below[0] if len(below) else _LAGS)
    # An autocorrelation of one half after `half`: exp(-half^2 / (4 lasts^2)).
    return TrackingJitter(float(np.sqrt(middle[0])), half / (2.0 * np.sqrt(np.log(2.0))))


def add_jitter(source: TrackSource, jitter: TrackingJitter, *, seed: int) -> TrackSource:
    """Let the positions of a source's vehicles jitter as a recording's do."""
    rng = np.random.default_rng(seed)
    reach = max(int(np.ceil(3.0 * jitter.lasts / STEP)), 1)
    kernel = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) * STEP / jitter.lasts))
    kernel *= jitter.spread / np.sqrt(np.square(kernel).sum())

    def blur(user: RoadUser) -> RoadUser:
        if user.shape.type != "vehicle":
            return user
        white = rng.standard_normal((2, len(user.track.xy) + 2 * reach))
        away = np.stack([np.convolve(each, kernel, mode="valid") for each in white], axis=1)
        return replace(user, track=replace(user.track, xy=user.track.xy + away))

    stretches = (replace(s, users=tuple(blur(u) for u in s.users)) for s in source.stretches)
    return replace(source, stretches=tuple(stretches))


CLASSES: tuple[AgentClass, ...] = ("vehicle", "pedestrian")
PARTS = ("all", "foreground", "background")
JITTERED = "all, with its jitter"
"""All vehicles, their positions jittering as standing ones do in what they are compared with."""
ProgressLog = Callable[[str], None]


@dataclass(frozen=True)
class SeparationTest:
    """One two-sample test.

    Attributes:
        type: class of agents; one, other: the data sets compared; part: of the first's agents.
        situation: `all`, or what the agents do; auc, groups: how well the two are separated.
        floor: whether both are recorded traffic, or halves of it.
    """

    type: AgentClass
    one: str
    other: str
    part: str
    situation: str
    auc: Figure
    groups: int
    floor: bool = False


@dataclass(frozen=True)
class MeasuredShare:
    """A share or mean of a data set: `name` of `source`, perhaps of its `part`."""

    source: str
    name: str
    part: str
    share: Figure


@dataclass(frozen=True)
class Likelihood:
    """How likely a reference is under a source; `source` is `log replay` for its own halves."""

    source: str
    reference: str
    type: AgentClass
    scores: Mapping[str, float]


@dataclass(frozen=True)
class Assessment:
    """The report."""

    tests: tuple[SeparationTest, ...]
    measures: tuple[MeasuredShare, ...]
    likelihoods: tuple[Likelihood, ...]
    notes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {"schema_version": 2, **asdict(self)}

    def format_markdown(self) -> str:
        """The tables."""
        columns = {
            "class": "{type}", "separated": "{one}", "part": "{part}", "from": "{other}",
            "situation": "{situation}", "AUC": "{auc:.3f}", "n a side": "{auc.n}",
            "groups": "{groups}",
        }  # fmt: skip
        tests = format_records(self.tests, columns)
        sources = list(dict.fromkeys(m.source for m in self.measures))
        cells = {
            (m.source, m.name, m.part): f"{m.share:.3f}, n = {m.share.n}" for m in self.measures
        }
        measures = [
            (name, part, *(cells.get((source, name, part), "–") for source in sources))
            for name, part in dict.fromkeys((m.name, m.part) for m in self.measures)
        ]
        names = ("all", *FEATURES)
        likelihoods = [
            (likelihood.type, likelihood.reference, likelihood.source,
             *(f"{likelihood.scores[name]:.3f}" if name in likelihood.scores else "–"
               for name in names))
            for likelihood in self.likelihoods
        ]  # fmt: skip
        parts = [
            f"### Two-sample test\n\n{format_table([*columns], tests)}",
            f"### On the street\n\n{format_table(('measure', 'part', *sources), measures)}",
            "### Likelihood of the reference\n\n"
            + format_table(("class", "reference", "under", *names), likelihoods),
            "\n".join(f"- {name}: {line}" for name, own in self.notes.items() for line in own),
        ]
        return "\n\n".join(part for part in parts if part) + "\n"


def assess(
    sets: Sequence[TrackSource],
    real: Sequence[TrackSource],
    *,
    corpus: TrackSource | None = None,
    mass_of: Callable[[str, int], FloatArray] | None = None,
    ground_of: Callable[[str], Any] | None = None,
    seed: int = 0,
    log: ProgressLog = lambda _: None,
) -> Assessment:
    """Compute every measure of every set, and of the real tracks for comparison.

    Args:
        sets: what is judged; real: recordings of real traffic; corpus: simulated traffic, reported
            and no yardstick.
        mass_of: p_tod of an intersection and hour; ground_of: the map of an intersection.
    """
    beside = (*real, *([corpus] if corpus is not None else []))
    tests = [
        each
        for kind in CLASSES
        for each in _run_tests(sets, real, beside, kind, seed=seed, log=log)
    ]
    measures = [
        each for source in (*sets, *beside) for each in _compute_measures(source, mass_of, seed)
    ]
    log("likelihoods")
    likelihoods = [
        each for kind in CLASSES for each in _score_likelihoods(sets, beside, kind, ground_of)
    ]
    notes = {each.name: each.notes for each in beside if each.notes}
    return Assessment(tuple(tests), tuple(measures), tuple(likelihoods), notes)


def _run_tests(
    sets: Sequence[TrackSource],
    real: Sequence[TrackSource],
    beside: Sequence[TrackSource],
    kind: AgentClass,
    *,
    seed: int,
    log: ProgressLog,
) -> Iterator[SeparationTest]:
    def run(
        one: str, other: str, *pair: list[MotionWindow], part: str = "all", floor: bool = False
    ) -> Iterator[SeparationTest]:
        for situation, found in compare_windows(*pair, seed=seed).items():
            yield SeparationTest(
                kind, one, other, part, situation, found.auc, found.groups, floor
            )  # fmt: skip

    cut = {each.name: cut_windows(each, kind) for each in (*sets, *beside)}
    for each in beside:
        log(f"{kind}s: halves of {each.name}")
        halves = split_halves(cut[each.name])
        yield from run(f"{each.name}, half", "the other", *halves, floor=True)
    for one, other in combinations(real, 2):
        log(f"{kind}s: {one.name} against {other.name}")
        yield from run(one.name, other.name, cut[one.name], cut[other.name], floor=True)
    for source, other, part in product(sets, beside, PARTS):
        log(f"{kind}s: {source.name}, {part}, against {other.name}")
        own = _select_part(cut[source.name], part)
        if part == "all" or 0 < len(own) < len(cut[source.name]):
            yield from run(source.name, other.name, own, cut[other.name], part=part)
    jitters = {each.name: measure_tracking_jitter(each) for each in beside if kind == "vehicle"}
    for other, source in product(beside, sets):
        # Vehicles once more, those of the set with the jitter of the other's tracking.
        jitter = jitters.get(other.name)
        if jitter is not None:
            log(f"vehicles: {source.name}, with the jitter of {other.name}")
            own = cut_windows(add_jitter(source, jitter, seed=seed), kind)
            yield from run(source.name, other.name, own, cut[other.name], part=JITTERED)


def _select_part(windows: list[MotionWindow], part: str) -> list[MotionWindow]:
    named = part == "foreground"
    return [window for window in windows if part == "all" or window.foreground == named]


def _compute_measures(
    source: TrackSource, mass_of: Callable[[str, int], FloatArray] | None, seed: int
) -> Iterator[MeasuredShare]:
    def share(name: str, parts: Any, part: str = "all") -> MeasuredShare:
        return MeasuredShare(source.name, name, part, compute_share(parts, seed=seed))

    for kind in CLASSES:
        windows = cut_windows(source, kind)
        for part in PARTS if any(window.foreground for window in windows) else PARTS[:1]:
            groups: dict[str, list[MotionWindow]] = {}
            for window in _select_part(windows, part):
                groups.setdefault(window.group, []).append(window)
            constant = [find_constant_speed(own) for own in groups.values()]
            yield share(f"{kind}s: 3 s at one speed", constant, part)
    for name, measure in MEASURES.items():
        yield share(name, [measure(stretch) for stretch in source.stretches])
    found = [find_reactions(stretch) for stretch in source.stretches]
    for event in ("collision", "near_miss"):
        pairs = [[pair for pair in own if pair[0].event == event] for own in found]
        word = event.replace("_", " ")
        yield share(
            f"{word}: a party reacts",
            [[one.reacts or two.reacts for one, two in own] for own in pairs],
        )
        for kind in CLASSES:
            reacts = [[p.reacts for pair in own for p in pair if p.kind == kind] for own in pairs]
            yield share(f"{word}: {kind}s that react", reacts)
    if mass_of is not None:
        for kind, values in compute_count_ranks(source.stretches, mass_of, seed=seed).items():
            if values:
                yield share(f"{kind}s in 30 s: place in p_tod, mean", values)


def _score_likelihoods(
    sets: Sequence[TrackSource],
    beside: Sequence[TrackSource],
    kind: AgentClass,
    ground_of: Callable[[str], Any] | None,
) -> Iterator[Likelihood]:
    features = {}
    for each in (*sets, *beside):
        places = {stretch.place for stretch in each.stretches}
        # A map is asked about sources alone that lie all at one intersection.
        place = places.pop() if len(places) == 1 else None
        ground = None if place is None or ground_of is None else ground_of(place)
        features[each.name] = measure_features(each.stretches, kind, ground=ground)
    for reference in beside:
        asked = features[reference.name][1::2]
        oracle = score_likelihood(features[reference.name][::2], asked, kind)
        if oracle:
            yield Likelihood("log replay", reference.name, kind, oracle)
        for source in (*sets, *beside):
            scores = score_likelihood(features[source.name], asked, kind)
            if source.name != reference.name and scores:
                yield Likelihood(source.name, reference.name, kind, scores)


def draw_assessment(report: Assessment) -> bytes:
    """Draw the page as PNG: two-sample tests by class, shares, likelihoods."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    page = Figure(figsize=(13, 11), layout="constrained")
    FigureCanvasAgg(page)
    axes = page.subplots(2, 2)
    for ax, kind in zip(axes[0], CLASSES, strict=True):
        _draw_tests(ax, [t for t in report.tests if t.type == kind and t.situation == "all"])
        ax.set_title(f"{kind}s: how well they are separated (0.5: not at all)")
    _draw_measures(axes[1][0], [m for m in report.measures if m.part == "all"])
    rows = list(reversed(report.likelihoods))
    for k, each in enumerate(rows):
        color = "0.6" if each.source == "log replay" else "#3b6ea5"
        axes[1][1].barh(k, each.scores.get("all", 0.0), color=color)
    labels = [f"{r.type}s of {r.reference}\nunder {r.source}" for r in rows]
    axes[1][1].set_yticks(range(len(rows)), labels, fontsize=6)
    axes[1][1].set_title("likelihood of the reference (grey: log replay)")
    buffer = io.BytesIO()
    page.savefig(buffer, dpi=100)
    return buffer.getvalue()


def _draw_tests(ax: Any, tests: Sequence[SeparationTest]) -> None:
    """Draw a bar for each test; floors, between real tracks, are grey."""
    for k, test in enumerate(reversed(tests)):
        color = "0.6" if test.floor else "#3b6ea5"
        ax.barh(k, (test.auc.value or 0.0) - 0.5, left=0.5, color=color)
        ax.plot([test.auc.low, test.auc.high], [k, k], color="black", lw=1)
    labels = [
        f"{t.one}{'' if t.part == 'all' else ', ' + t.part}\nfrom {t.other} (n = {t.auc.n})"
        for t in reversed(tests)
    ]
    ax.set_yticks(range(len(tests)), labels, fontsize=7)
    ax.set_xlim(0.4, 1.0)
    ax.axvline(0.5, color="black", lw=0.8)


def _draw_measures(ax: Any, measures: Sequence[MeasuredShare]) -> None:
    names = list(dict.fromkeys(m.name for m in measures))
    sources = list(dict.fromkeys(m.source for m in measures))
    for j, source in enumerate(sources):
        own = [m for m in measures if m.source == source and m.share.value is not None]
        y = [len(names) - names.index(m.name) - j / (len(sources) + 1) for m in own]
        x = [m.share.value or 0.0 for m in own]
        off = [[v - (m.share.low or 0.0) for v, m in zip(x, own, strict=True)],
               [(m.share.high or 0.0) - v for v, m in zip(x, own, strict=True)]]  # fmt: skip
        ax.errorbar(x, y, xerr=off, fmt="o", ms=4, lw=1, label=source)
    ax.set_yticks([len(names) - k - 0.4 for k in range(len(names))], names, fontsize=7)
    ax.set_xlim(-0.03, 1.03)
    ax.set_title("shares, and places in p_tod")
    if sources:
        ax.legend(fontsize=7, loc="center right")
