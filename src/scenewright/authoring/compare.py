"""Two versions, agent by agent."""

from __future__ import annotations

from typing import Any

from scenewright.backends.offline import WORDS
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord


def compare_versions(
    a: SceneRecord, a_proof: Proof, b: SceneRecord, b_proof: Proof
) -> dict[str, Any]:
    """Agents that are the same, that differ, that are in one alone; and the events of either."""
    first = {agent.name: agent for agent in a.agents}
    second = {agent.name: agent for agent in b.agents}
    both = [name for name in first if name in second]
    same = [name for name in both if first[name] == second[name]]
    rows = (
        ("verdict", a_proof.describe_verdict(), b_proof.describe_verdict()),
        ("events", _format_events(a, a_proof), _format_events(b, b_proof)),
        ("agents", str(len(a.agents)), str(len(b.agents))),
        ("time of day", a.meta.time_of_day, b.meta.time_of_day),
        ("duration", f"{a.meta.duration:g} s", f"{b.meta.duration:g} s"),
    )
    return {
        "same": same,
        "changed": [name for name in both if name not in same],
        "only_first": [name for name in first if name not in second],
        "only_second": [name for name in second if name not in first],
        "differences": [list(row) for row in rows if row[1] != row[2]],
    }


def _format_events(record: SceneRecord, proof: Proof) -> str:
    names = {agent.id: agent.name for agent in record.agents}
    events = []
    for event in proof.events:
        figures = ", ".join(
            words.format(event.evidence[key])
            for key, words in WORDS["answer_question"]["figures"].items()
            if isinstance(event.evidence.get(key), float)
        )
        pair = f"{names.get(event.from_, event.from_)} and {names.get(event.to, event.to)}"
        measured = f" ({figures})" if figures else ""
        events.append(f"{event.type.replace('_', ' ')} of {pair} at {event.time:.1f} s{measured}")
    return "; ".join(events) or "nothing happens"
