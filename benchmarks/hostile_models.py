"""Whether language models that plan something other than the request ever get a verified scene.

    python benchmarks/hostile_models.py [--show]

Every request is two clauses, of which the plan holds the first alone (`half`), or one clause with
another plan (`swapped` roles, another `class`). `invented` is half a plan with words that the
request does not hold, `borrowed` and `served` one whose words are called what was planned: parts of
the plan, or constraints and behavior, which the model then serves with what holds anyway.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright import synthesize
from scenewright.backends import Question
from scenewright.errors import Rejected, ScenewrightError
from scenewright.graph.run import Scene

sys.path.append(str(Path(__file__).parents[1] / "tests"))
SCRIPTED: Any = importlib.import_module("scripted")
Plan = dict[str, Any]
CLAUSES = (
    ("A car yields to a pedestrian", "car yield_to pedestrian"),
    ("A bus hits a van", "bus collide_at van"),
    ("A taxi follows a truck", "taxi follow truck"),
    ("A cyclist yields to a car", "cyclist yield_to car"),
    ("A van yields to a cyclist", "van yield_to cyclist"),
    ("A motorcycle hits a taxi", "motorcycle collide_at taxi"),
    ("A pedestrian yields to a bus", "pedestrian yield_to bus"),
)
"""What the model plans, and how."""
SECOND = (
    "and a truck runs a red light and hits a van", "and then hits a cyclist",
    "while another car yields to another pedestrian", "after a motorcycle cuts in front of it",
    "twice", "and then runs a red light", "then a second bus stops behind it",
    "and two pedestrians cross on the north crosswalk", "before a child darts out",
    "and a taxi brakes hard", "and both stop for five seconds", "at 50 km/h", "on the fifth lane",
    "and a scooter rider yields to a woman", "because a parked truck hides a cyclist",
    "meanwhile a van tailgates a taxi", "and a truck makes a U-turn", "and nearly hits a taxi",
    "and an ambulance from the north turns left", "without slowing down", "with a PET of 7.5 s",
)  # fmt: skip
"""What it leaves out."""
KINDS = ("half", "swapped", "class", "invented", "borrowed", "served")
_OTHER = {
    "car": "bus", "bus": "motorcycle", "taxi": "truck", "cyclist": "pedestrian", "van": "taxi",
    "motorcycle": "cyclist", "pedestrian": "cyclist",
}  # fmt: skip
_PARTS = ("relation", "cause", "order", "motion", "manner")


@dataclass(frozen=True)
class Attack:
    """A request, and a model that plans something else."""

    kind: str
    text: str
    plan: Plan
    seed: int

    @property
    def name(self) -> str:
        return f"{self.kind} {self.seed}: {self.text}"

    def make(self) -> Scene | None:
        """The scene that comes of it; None where the request is refused."""
        script: dict[Any, list[Any]] = {
            "plan": [self.plan], "constraints": [_serve_clauses], "behavior": [_serve_stops]
        }  # fmt: skip
        backend = SCRIPTED.build_scripted_backend(script, forever=True)
        try:
            return synthesize(self.text, backend=backend, seed=self.seed, refiner="none")
        except (ScenewrightError, Rejected):
            return None


def list_attacks() -> Iterator[Attack]:
    """Every attack: each second clause with a first one."""
    for n, second in enumerate(SECOND):
        first, roles = CLAUSES[n % len(CLAUSES)]
        for kind in KINDS:
            text = first if kind in ("swapped", "class") else f"{first} {second}"
            yield Attack(kind, text, build_plan(roles, first, second, kind), seed=n)


def build_plan(roles: str, first: str, second: str, kind: str) -> Plan:
    """The plan of the first clause as a model of this kind makes it."""
    one, relation, two = roles.split()
    if kind == "class":
        one = _OTHER[one]
    names: list[str] = []
    agents: list[dict[str, str]] = []
    for each in (one, two):
        found = each if each in ("pedestrian", "cyclist") else "vehicle"
        names.append(f"{found}-{1 + sum(n.startswith(found) for n in names)}")
        agents.append({"id": names[-1]} | ({"subtype": each} if found == "vehicle" else {}))
    from_, to = reversed(names) if kind == "swapped" else names
    words = {
        "invented": [("a truck runs it over", "relation"), ("=", "order"), ("für 5 s", "motion")],
        "borrowed": [(second, part) for part in _PARTS],
        "served": [(second, "constraint"), (second, "behavior")],
    }.get(kind, [(first.split()[2], "relation")])
    return {
        "agents": agents,
        "relations": [{"type": relation, "from": from_, "to": to}],
        "context": {"background": {"vehicles": 0, "pedestrians": 0}},
        "said": [{"words": each, "became": part, "agents": names} for each, part in words],
    }


def _serve_clauses(question: Question) -> dict[str, Any]:
    """A speed for every word that any agent has."""
    speed = {"clause": "speed", "low": 0.1, "high": 19}
    served = [
        {**speed, "words": each["number"], "agent": each["agents"][0]}
        for each in question.facts["words"]
    ]
    return {"clauses": served, "cannot": []}


def _serve_stops(question: Question) -> dict[str, Any]:
    """A standstill for every word at the first place of an agent."""
    agent = question.facts["agents"][0]
    place = {"agent": agent["agent"], "place": agent["anchors"][0]["id"], "ahead": 3, "lasts": 1}
    return {"stops": [{**place, "words": each["number"]} for each in question.facts["words"]],
            "cannot": []}  # fmt: skip


def main() -> int:
    """Print how many attacks end in a verified scene, by kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--show", action="store_true", help="print what comes of each attack")
    show = parser.parse_args().show
    made, verified = Counter[str](), Counter[str]()
    for attack in list_attacks():
        scene = attack.make()
        verdict = "refused" if scene is None else scene.proof.verdict
        made[attack.kind] += 1
        verified[attack.kind] += verdict == "verified"
        if show or verdict == "verified":
            print(f"{verdict}: {attack.name}")
        if scene is not None:
            for each in scene.proof.account:
                print(f"    {each.words}: {each.state} ({each.claim}; {each.evidence})")
    for kind, count in made.items():
        print(f"{kind}: {verified[kind]} of {count} verified")
    return min(1, verified.total())


if __name__ == "__main__":
    sys.exit(main())
