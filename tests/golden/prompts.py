"""One prompt of every kind, with facts set down by hand: two agents bound, ten in the scene."""

from __future__ import annotations

import json

from scenewright.backends import Prompt
from scenewright.nodes.event_reasoner.prompts import render_stops_prompt
from scenewright.nodes.prompts import Example
from scenewright.nodes.revision.prompts import render_edits_prompt
from scenewright.nodes.scene_planner import FOUR_LEGS
from scenewright.nodes.scene_planner.prompts import render_plan_prompt
from scenewright.nodes.waypoint_filter.prompts import render_clauses_prompt
from scenewright.scene.behavior import AgentSummary, Anchor, EventSummary, Stay
from scenewright.scene.edits import AgentView, Situation
from scenewright.scene.social import SocialGraph
from scenewright.tools.event_summary import to_facts

TEXT = (
    "Busy morning rush: a northbound van turning right breaks off its right turn for a woman who "
    'walks south on the east crosswalk, "PET" 1.5 s, with eight other cars around.'
)
LEFT = (
    "A northbound van doing 30 km/h creeps forward, stops twice and yields to a woman who walks "
    'south on the east crosswalk at "1.2 m/s".'
)
PLAN = {
    "agents": [{"id": "vehicle-1", "type": "vehicle", "entry": "south", "movement": "right"}],
    "relations": [],
}
RELATION = {
    "type": "yield_to",
    "from": "vehicle-1",
    "to": "pedestrian-1",
    "striker": "vehicle-1",
    "struck": "pedestrian-1",
    "pattern": "vehicle_yields_to_pedestrian_right_turn",
    "kind": None,
    "cause": None,
    "target_pet": 1.5,
    "target_ttc": None,
    "impact_speed": None,
    "point_from": None,
    "point_to": None,
}
FACTS = {
    "instruction": LEFT,
    "words": [
        {"number": 1, "words": "doing 30 km/h", "agents": ["vehicle-1"]},
        {"number": 2, "words": 'at "1.2 m/s"', "agents": ["pedestrian-1"]},
    ],
    "agents": [
        {"id": "vehicle-1", "type": "vehicle", "movement": "right"},
        {"id": "pedestrian-1", "type": "pedestrian", "movement": "crossing"},
    ],
    "relations": [RELATION],
    "program": "min_length(vehicle-1) >= 30 m\ngives_way(vehicle-1, pedestrian-1)",
}
WORDS = [
    {"number": 1, "words": "creeps forward", "agents": ["vehicle-1"]},
    {"number": 2, "words": "stops twice", "agents": ["vehicle-1"]},
]


def plan() -> Prompt:
    return render_plan_prompt(
        TEXT,
        "A car hits a bus.",
        FOUR_LEGS,
        rejections=("vehicle-1: entry up is none of north, east, south, west",),
        examples=(Example("A van turns right from the south.", PLAN),),
    )


def constraints() -> Prompt:
    fault = "nothing is said of words 2; serve them, or list them under 'cannot'"
    return render_clauses_prompt(FACTS, ("north", "east", "south", "west"), rejections=(fault,))


def behavior() -> Prompt:
    fault = "vehicle-1 has no anchor 'south:line'"
    facts = {
        "instruction": LEFT, "words": WORDS, "relations": ["vehicle-1 yield_to pedestrian-1"],
        **to_facts(_summary()),
    }  # fmt: skip
    return render_stops_prompt(facts, _summary(), rejections=(fault,))


def edits() -> Prompt:
    return render_edits_prompt(
        'now have it be a collision, "5 pm", and two trucks more',
        SITUATION,
        before=TEXT,
        ways=FOUR_LEGS,
        chosen={"truck": "vehicle-1"},
        rejections=("there is no vehicle-9 in the scene",),
    )


def _situation() -> Situation:
    kinds = {
        "vehicle-1": ("south", "east", "right"),
        "pedestrian-1": ("north", "south", "crossing"),
    }
    front = [
        AgentView(
            id=name, number=n, type=name.partition("-")[0], entry=way[0], exit=way[1],
            movement=way[2], crosswalk="east" if n else None, role="foreground",
            speed=1.4 if n else 8.2, stops=not n, subtype=None if n else "truck",
        )
        for n, (name, way) in enumerate(kinds.items())
    ]  # fmt: skip
    others = [
        AgentView(
            id=f"vehicle-{n}", number=n, type="vehicle", subtype="car", entry="west", exit="east",
            movement="straight", role="background", speed=9.0,
        )
        for n in range(2, 10)
    ]  # fmt: skip
    nodes = [{"id": each.id, "type": each.type} for each in front]
    relation = {"type": "yield_to", "from": "vehicle-1", "to": "pedestrian-1", "target_pet": 1.5}
    plan = {"agents": nodes, "relations": [relation], "context": {"density": "high"}}
    return Situation(graph=SocialGraph.model_validate(plan), present=(*front, *others))


SITUATION = _situation()


def _summary() -> EventSummary:
    stay = Stay(anchor="yield_point@34.6", start=16.431, until=18.48, reason="gives_way")
    car = AgentSummary(
        agent="vehicle-1",
        enters=10.1,
        leaves=27.0,
        anchors=_anchors(
            "south:stop 13.321", "yield_point@34.6 13.454", "south:crosswalk:entry 13.535",
            "south:crosswalk:exit 15.552", "east:crosswalk:entry 14.8",
            "east:crosswalk:exit 16.886", "goal",
        ),
        stays=(stay,),
    )  # fmt: skip
    walker = AgentSummary(
        agent="pedestrian-1",
        enters=-1.1,
        leaves=27.0,
        anchors=_anchors(
            "east:kerb:north 8.721", "east:crosswalk:entry 8.721", "east:crosswalk:exit 19.315",
            "goal",
        ),
    )  # fmt: skip
    evidence = {"clause": "gives_way(vehicle-1, pedestrian-1)", "time": 16.431}
    return EventSummary(duration=27.0, agents=(car, walker), evidence=(evidence,))


def _anchors(*told: str) -> tuple[Anchor, ...]:
    found = []
    for s, each in enumerate(told):
        name, _, time = each.partition(" ")
        found.append(Anchor(id=name, s=10.0 * s, time=float(time) if time else None))
    return tuple(found)


def as_text(prompt: Prompt) -> str:
    """Everything that a model is sent."""
    schema = json.dumps(prompt.schema, indent=1)
    return f"{prompt.system}\n\n=== user ===\n{prompt.user}\n\n=== schema ===\n{schema}\n"
