"""ASAM OpenSCENARIO DSL 2.1: what a scene was asked for, as constraints (`scene/osc_dsl.py`)."""

from __future__ import annotations

from typing import Any

from scenewright.scene.events import RELATION_OF_EVENT
from scenewright.scene.osc_dsl import write_osc_dsl
from scenewright.scene.record import SceneRecord
from scenewright.tools.formats.exported_scene import ExportedScene

_OF_AGENT = ("subtype", "entry", "exit", "movement", "crosswalk", "reaction", "motion")
_OF_RELATION = (
    "kind", "cause", "manoeuvre", "target_pet", "target_ttc", "impact_speed", "point_from",
    "point_to",
)  # fmt: skip


def write(scene: ExportedScene) -> dict[str, bytes]:
    """The .osc of a scene: the plan that it was made from, else that of its record."""
    record, plan = scene.record, scene.record.meta.plan
    if plan is None:
        data = _build_plan(record)
    else:
        data = plan.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    text = write_osc_dsl(
        scene.name, {**data, "text": record.meta.user_prompt}, spreads={}, legs={},
        places=(record.meta.intersection,),
    )  # fmt: skip
    return {f"{scene.name}.osc": text.encode()}


def _build_plan(record: SceneRecord) -> dict[str, Any]:
    """The fields of the plan that the record of a scene holds, without what stands on the road."""
    names = {agent.id: agent.name for agent in record.agents}
    return {
        "agents": [
            {"id": agent.name, **_list_set(agent, _OF_AGENT)}
            | ({"runs_red": True} if agent.violates_signal else {})
            for agent in record.agents
            if agent.role == "foreground"
        ],
        "relations": [
            {"type": RELATION_OF_EVENT[relation.type],
             "from": names[relation.from_], "to": names[relation.to]}
            | _list_set(relation, _OF_RELATION)
            | {
                key: names[number]
                for key, number in (
                    ("braker", relation.cause_agent), ("first", relation.first),
                    ("strikes", relation.strikes),
                )
                if number is not None
            }
            for relation in record.relations
        ],
        "ties": [
            {"agent": names[tie.agent], "of": names[tie.of], "side": tie.side}
            for tie in record.ties
        ],
        "measures": [
            {"kind": measure.kind, "agent": names[measure.agent],
             "low": measure.low, "high": measure.high}
            | ({} if measure.other is None else {"other": names[measure.other]})
            for measure in record.measures
        ],
        "context": {"time_of_day": record.meta.time_of_day}
        | ({"density": record.meta.density} if record.meta.density else {}),
    }  # fmt: skip


def _list_set(record: Any, names: tuple[str, ...]) -> dict[str, Any]:
    return {name: value for name in names if (value := getattr(record, name)) is not None}
