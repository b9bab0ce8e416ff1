"""Words that no field of the plan holds: who is asked about them, once, and what comes of it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from scenewright import synthesize
from scenewright.authoring.session import Session
from scenewright.backends import Question, load_backend
from scenewright.cli.turn_report import format_reply
from scenewright.errors import InputError, Rejected
from scenewright.geometry.map_areas import MapAreas
from scenewright.graph.run import Scene
from scenewright.intersections import load_map
from scenewright.memory.threads import Threads
from scenewright.nodes.context import RunContext
from scenewright.nodes.event_reasoner import edit_segments
from scenewright.nodes.event_reasoner.reply import SegmentReply
from scenewright.nodes.waypoint_filter import solve_program
from scenewright.scene.constraints import SpeedBetween
from scenewright.scene.plan_file import PlanFile
from scenewright.scene.rejection import Rejection
from scenewright.scene.remaining import AddedStop, AddedStops
from scenewright.tools.added_stops import place_stops
from scenewright.tools.gmm_sampler import load_priors

CAR, WALKER = "vehicle-1", "pedestrian-1"
PLAIN = "A car from the south turning right yields to a pedestrian."
SPEED = {"words": 1, "clause": "speed", "agent": CAR, "low": 8.0, "high": 8.8}
GROUND = MapAreas(load_map("amsterdam_120"))


class Scripted:
    """Plans a yield with these entries in its account; the last reply of a task is for good."""

    name, deterministic = "scripted", False

    def __init__(self, *said: tuple[str, str, str], **replies: list[Any]) -> None:
        self._said = [{"words": w, "became": b, "agents": [a]} for w, b, a in said]
        self._replies = replies
        self.asked: list[Question] = []

    def answer(self, question: Question) -> dict[str, Any]:
        self.asked.append(question)
        if question.task == "plan":
            return {
                "agents": [
                    {"id": CAR, "type": "vehicle", "subtype": "car", "entry": "south",
                     "movement": "right"},
                    {"id": WALKER, "type": "pedestrian"},
                ],
                "relations": [{"type": "yield_to", "from": CAR, "to": WALKER}],
                "context": {"background": {"vehicles": 0, "pedestrians": 0}},
                "said": [
                    {"words": "yields to a pedestrian", "became": "relation",
                     "agents": [CAR, WALKER], "value": "yield_to"},
                    *self._said,
                ],
            }  # fmt: skip
        replies = self._replies[question.task]
        reply = replies[0] if len(replies) == 1 else replies.pop(0)
        made: dict[str, Any] = reply(question) if callable(reply) else reply
        return made

    @property
    def tasks(self) -> list[str]:
        return [each.task for each in self.asked]


def a_stop(question: Question) -> dict[str, Any]:
    """A standstill of 1.5 s, 6 m before the place where the car gives way, or its stop line."""
    car = next(each for each in question.facts["agents"] if each["agent"] == CAR)
    places = [anchor["id"] for anchor in car["anchors"]]
    place = next((each for each in places if each.startswith("yield_point")), places[0])
    stop = {"words": 1, "agent": CAR, "place": place, "ahead": 6.0, "lasts": 1.5}
    return {"stops": [stop], "cannot": []}


def made(text: str, backend: Any, *, seed: int = 0, **more: Any) -> Scene:
    return synthesize(text, backend=backend, seed=seed, refiner="none", **more)


def hesitating(*replies: Any) -> Scripted:
    return Scripted(("hesitates", "behavior", CAR), behavior=list(replies))


HESITATES = "A car from the south turning right hesitates and yields to a pedestrian."
DRIVES = "A car doing 30 km/h turns right and yields to a pedestrian."


def speeding(*replies: Any) -> Scripted:
    return Scripted(("doing 30 km/h", "constraint", CAR), constraints=list(replies))


def test_a_plan_says_which_words_a_change_does_not_keep(tmp_path: Path) -> None:
    backend = hesitating(a_stop)
    graph = made(HESITATES, backend).state["social_graph"]
    threads = Threads(tmp_path / "threads.sqlite")
    setting = {"intersection": "amsterdam_120", "seed": 0, "refiner": "none"}
    session = Session(threads, "plans", backend=backend, setting=setting)
    reply = session.make_plan(PlanFile(graph))
    assert reply["note"] == "no field holds 'hesitates': a change must say it again"
    lines = [line for _, line in format_reply(reply, session.find_version())]
    assert any("'hesitates'" in line for line in lines)
    assert "note" not in session.make_plan(PlanFile(graph.model_copy(update={"said": ()})))
    threads.close()


def test_a_plain_instruction_asks_for_the_plan_alone() -> None:
    backend = Scripted()
    assert made(PLAIN, backend).proof.verified
    assert backend.tasks == ["plan"]


def test_any_backend_gets_the_program_and_the_segments_that_builtin_gets() -> None:
    ours, theirs = made(PLAIN, load_backend("builtin")), None
    graph = ours.state["social_graph"]
    theirs = made(PLAIN, Scripted(), planned=graph)
    assert theirs.record == ours.record


def test_a_remaining_speed_is_put_to_the_filter_once_and_proven() -> None:
    backend = speeding({"clauses": [SPEED], "cannot": []})
    scene = made(DRIVES, backend)
    assert backend.tasks == ["plan", "constraints"]
    [question] = backend.asked[1:]
    assert question.facts["words"] == [{"number": 1, "words": "doing 30 km/h", "agents": [CAR]}]
    assert f"gives_way({CAR}, {WALKER})" in question.facts["program"]
    assert SpeedBetween(agent=CAR, low=8.0, high=8.8) in scene.state["constraints"].clauses
    [entry] = [each for each in scene.proof.account if each.words == "30 km/h"]
    assert (entry.state, entry.claim) == ("seen", "number 8.33 m/s")
    assert 8.0 <= scene.state["selection"].agents[CAR].candidate.time_law.speed <= 8.8


def test_hesitating_is_put_to_the_reasoner_once_and_seen_on_the_track() -> None:
    backend = hesitating(a_stop)
    scene = made(HESITATES, backend)
    assert backend.tasks == ["plan", "behavior"]
    [entry] = [each for each in scene.proof.account if each.words == "hesitates"]
    assert (entry.state, entry.claim) == ("seen", "event yielding")
    [stop] = [s for s in scene.state["selection"].agents[CAR].stops if s.reason == "asked"]
    assert stop.until - stop.start == pytest.approx(1.5, abs=0.11)
    segments = [(s.status, s.start) for s in scene.state["behavior"].segments[CAR]]
    assert ("stop", round(stop.start, 3)) in segments


@pytest.mark.parametrize("seed", range(3))
def test_who_hesitates_gives_way_when_it_was_to(seed: int) -> None:
    """The car enters as much earlier as it loses: the yield is where and when it was solved."""
    scene = made(HESITATES, hesitating(a_stop), seed=seed)
    chosen = scene.state["selection"]
    car = chosen.agents[CAR]
    stop = next(each for each in car.stops if each.reason == "asked")
    event = next(each for each in chosen.events if CAR in each.agents)
    track = scene.state["edited"][CAR]
    at = track.xy[round((event.time - track.start) / 0.1)]
    assert stop.until < event.time
    gap = ((at - scene.state["edited"][CAR].xy) ** 2).sum(axis=1).min()
    assert gap == 0.0
    assert [each.type for each in scene.proof.events] == ["yielding"]


def test_after_a_failed_sample_no_agent_is_asked_again() -> None:
    """Free speeds in so narrow a range are drawn by few samples."""
    narrow = {**SPEED, "low": 8.0, "high": 8.4}
    failed = 0
    for seed in range(1, 5):
        backend = speeding({"clauses": [narrow], "cannot": []})
        scene = made(DRIVES, backend, seed=seed)
        refused = scene.provenance["rejections"]
        failed += any(each["code"] == "no_surviving_combination" for each in refused)
        assert backend.tasks == ["plan", "constraints"]
        assert 8.0 <= scene.state["selection"].agents[CAR].candidate.time_law.speed <= 8.4
    assert failed > 0


def test_neither_is_the_reasoner() -> None:
    """Behind a red light, or out of the scene, a sample has no room for the standstill."""
    failed = 0
    for seed in range(6):
        backend = hesitating(a_stop)
        scene = made(HESITATES, backend, seed=seed)
        failed += len(scene.provenance["rejections"]) > 0
        assert backend.tasks == ["plan", "behavior"]
    assert failed > 0


@pytest.mark.parametrize(
    ("reply", "detail"),
    [
        ({"clauses": [], "cannot": []}, "nothing is said of words 1"),
        ({"clauses": [{**SPEED, "words": 2}], "cannot": [1]}, "numbered from 1 to 1"),
        ({"clauses": [{**SPEED, "agent": "vehicle-9"}]}, "agents are pedestrian-1, vehicle-1"),
        ({"clauses": [{"words": 1, "clause": "headway", "first": CAR, "second": WALKER,
                       "low": 1, "high": 2}]}, "is not offered"),
        ({"clauses": [{"words": 1, "clause": "runs_red", "agent": CAR}]}, "is not offered"),
        ({"clauses": [{**SPEED, "low": 9.9}]}, "is empty"),
        ({"program": "speed(vehicle-1)"}, "there is no such key"),
    ],
)  # fmt: skip
def test_a_reply_that_does_not_serve_the_words_is_mended(reply: Any, detail: str) -> None:
    backend = speeding(reply, {"clauses": [SPEED], "cannot": []})
    scene = made(DRIVES, backend)
    first = scene.provenance["rejections"][0]
    assert first["stage"] == "waypoint_filter"
    assert detail in first["detail"]
    assert backend.asked[2].rejections == (first["detail"],)


@pytest.mark.parametrize(
    ("change", "detail"),
    [
        ({"agent": "vehicle-9"}, "is not asked about"),
        ({"place": "moon"}, "has no anchor 'moon'"),
        ({"place": "goal", "ahead": 0.0}, "has no way"),
        ({"lasts": 0.2}, "greater than or equal to 1"),
        ({"words": 4}, "numbered from 1 to 1"),
    ],
)
def test_a_standstill_that_cannot_be_is_mended(change: dict[str, Any], detail: str) -> None:
    def wrong(question: Question) -> dict[str, Any]:
        good = a_stop(question)
        return {**good, "stops": [{**good["stops"][0], **change}]}

    backend = hesitating(wrong, a_stop)
    scene = made(HESITATES, backend, seed=0)
    first = scene.provenance["rejections"][0]
    assert first["stage"] == "event_reasoner"
    assert detail in first["detail"]
    assert backend.asked[2].rejections == (first["detail"],)


CANNOT = {"clauses": [], "cannot": [1]}


@pytest.mark.parametrize(
    ("backend", "asked"),
    [
        (lambda: speeding(CANNOT), 1),
        (lambda: speeding({"clauses": [], "cannot": []}), 3),
        (lambda: speeding({"nonsense": 1}), 3),
        (lambda: hesitating({"stops": [], "cannot": [1]}), 1),
        (lambda: hesitating({"stops": []}), 3),
    ],
)
def test_words_that_stay_unserved_are_refused_or_left_out_by_name(backend: Any, asked: int) -> None:
    text = DRIVES if "constraints" in backend()._replies else HESITATES
    words = "doing 30 km/h" if text == DRIVES else "hesitates"
    strict = backend()
    with pytest.raises(InputError, match=f"cannot be part of a scene: '{words}'"):
        made(text, strict)
    assert len(strict.asked) == 1 + asked
    lenient = backend()
    scene = made(text, lenient, lenient=True)
    assert len(lenient.asked) == 1 + asked
    entry = next(each for each in scene.record.said if each.words == words)
    assert entry.became == "nothing"
    assert entry.note


def test_a_filter_by_rule_reads_speeds_and_says_what_it_cannot_read() -> None:
    rule = load_backend("builtin")
    words = [
        {"number": 1, "words": "at 30 km/h", "agents": [CAR]},
        {"number": 2, "words": "at over 30 km/h", "agents": [CAR]},
        {"number": 3, "words": "at 9 m/s", "agents": [WALKER]},
        {"number": 4, "words": "two metres behind", "agents": [CAR]},
    ]
    reply = rule.answer(Question("constraints", {"words": words}))
    assert reply["cannot"] == [2, 3, 4]
    [clause] = reply["clauses"]
    assert (clause["clause"], clause["agent"]) == ("speed", CAR)
    assert (clause["low"], clause["high"]) == (7.83, 8.83)


def test_builtin_takes_a_speed_and_the_checker_finds_it() -> None:
    scene = made("A car doing 8 m/s yields to a pedestrian, nobody else around.", "builtin", seed=1)
    [entry] = [each for each in scene.proof.account if each.words == "8 m/s"]
    assert (entry.state, entry.claim) == ("seen", "number 8 m/s")


def test_builtin_still_refuses_what_it_cannot_show() -> None:
    for words in ("in the snow", "stops twice and"):
        with pytest.raises(
            InputError, match=r"cannot be part of a scene|would show something else"
        ):
            made(f"A car {words} hits a pedestrian", "builtin")


@pytest.fixture(scope="module")
def run() -> dict[str, Any]:
    """Every product of one run of the builtin backend."""
    text = "A car from the north turning left yields to an oncoming car, nobody else, at noon."
    return dict(made(text, "builtin", seed=3).state)


def runtime(**more: Any) -> Any:
    context = RunContext(
        backend=load_backend("builtin"), ground=GROUND, priors=load_priors("amsterdam_120"),
        seed=3, **more,
    )  # fmt: skip
    return SimpleNamespace(context=context)


def test_an_agents_own_program_is_read_and_checked(run: dict[str, Any]) -> None:
    for program, detail in (
        ("gives_way(vehicle-1)", "line 1"),
        ("contact(vehicle-1, vehicle-99)", "there is no vehicle-99 in the scene"),
        ("on_road(vehicle-1)", "lacks gives_way(vehicle-1, vehicle-2)"),
    ):
        with pytest.raises(Rejected, match="malformed_program") as caught:
            solve_program(program, run, runtime=runtime())  # type: ignore[arg-type]
        assert detail in caught.value.rejection.detail


def refused_segments(run: dict[str, Any], agent: str, *given: tuple[Any, ...]) -> Rejection:
    fields = ("start", "end", "anchor", "status")
    segments = [SegmentReply(**dict(zip(fields, each, strict=True))) for each in given]
    with pytest.raises(Rejected) as caught:
        edit_segments({agent: segments}, run, runtime=runtime())  # type: ignore[arg-type]
    return caught.value.rejection


@pytest.mark.parametrize(
    ("segments", "code", "detail"),
    [
        ([], "malformed_reply", "has no segments"),
        ([(0, 5, "moon", "keep")], "unknown_anchor", "no anchor 'moon'"),
        ([(0, 5, "contact", "stop")], "unknown_anchor", "no anchor 'contact'"),
        ([(5, 4, "goal", "keep")], "times_not_increasing", "ends before 5 s"),
        ([(0, 5, "goal", "keep"), (4, 9, "goal", "keep")], "times_not_increasing", "overlaps"),
        ([(0, 0, "goal", "terminate")], "segment_off_track", "m away then"),
        ([(0, 9, "goal", "keep")], "malformed_reply", "has no stop, which its role demands"),
    ],
)
def test_segments_that_cannot_be_edited_are_refused(
    run: dict[str, Any], segments: list[tuple[Any, ...]], code: str, detail: str
) -> None:
    rejection = refused_segments(run, CAR, *segments)
    assert (rejection.stage, rejection.code) == ("event_reasoner", code)
    assert rejection.agents == (CAR,)
    assert detail in rejection.detail


def test_a_stop_before_the_agent_gets_there_is_reported_when_it_does(run: dict[str, Any]) -> None:
    *others, before, stop, after = run["behavior"].segments[CAR]
    soon = stop.start - 1.5
    sooner = [before.model_copy(update={"end": soon}), stop.model_copy(update={"start": soon})]
    given = [(s.start, s.end, s.anchor, s.status) for s in (*others, *sooner, after)]
    rejection = refused_segments(run, CAR, *given)
    assert rejection.code == "segment_off_track"
    assert f"stands at {stop.anchor} from {soon:g} s, but comes at" in rejection.detail


def test_the_solvers_own_segments_fit_their_tracks(run: dict[str, Any]) -> None:
    given = {
        name: [SegmentReply(**each.model_dump()) for each in segments]
        for name, segments in run["behavior"].segments.items()
    }
    written = edit_segments(given, run, runtime=runtime())  # type: ignore[arg-type]
    assert written["behavior"] == run["behavior"]


def test_segments_of_an_agent_that_is_not_there_are_refused(run: dict[str, Any]) -> None:
    rejection = refused_segments(run, "vehicle-99", (0, 5, "goal", "keep"))
    assert rejection.detail == "vehicle-99 is not in the scene"


def placed(run: dict[str, Any], **stop: Any) -> Rejection:
    own = AddedStop.model_validate({"entry": 0, "agent": CAR, "lasts": 1.5, "ahead": 9.0, **stop})
    with pytest.raises(Rejected) as caught:
        place_stops(AddedStops(stops=(own,)), run["selection"], map_areas=GROUND)
    return caught.value.rejection


def test_only_another_sample_mends_a_standstill_out_of_the_scene(run: dict[str, Any]) -> None:
    """The car comes to its red light when the scene has just begun."""
    rejection = placed(run, place="north:stop", lasts=9.0)
    assert rejection.code == "segment_off_track"
    assert "would stand from -" in rejection.detail
    assert not rejection.repairable


def test_a_place_of_that_kind_on_another_way_is_the_place(run: dict[str, Any]) -> None:
    rejection = placed(run, place="south:stop", lasts=9.0)
    assert "would stand from -" in rejection.detail
    assert "has no anchor 'moon'" in placed(run, place="moon").detail
