"""Why words were refused, as far as is known."""

from __future__ import annotations

from collections import Counter

from scenewright.authoring.thread_state import RefusedTurn

_STAGES = {
    "scene_planner": "binding it to the map",
    "agent_generator": "drawing agents",
    "waypoint_filter": "solving for paths and times",
    "event_reasoner": "reasoning about the segments",
    "trajectory_refiner": "refining the tracks",
    "scene_verifier": "checking the tracks",
}
_ADVICE = {
    "out_of_scope": "Say which vehicles or pedestrians shall do what.",
    "no_change": "Name what shall be different.",
    "impossible": "`scenewright intersections show NAME` lists the ways there are.",
    "ungroundable": "`scenewright intersections show NAME` lists the ways there are.",
    "no_surviving_combination": "Fewer others, fewer fixed directions or a gentler figure helps.",
    "background_interferes": "Fewer others may help.",
    "relation_not_realised": "A less exact request may help.",
    "wrong_braker": "A less exact request may help.",
    "implausible_motion": "A gentler request may help.",
    "unlawful": "Say that the light is run, or let it be run unasked (without --lawful).",
    "work_spent": "Fewer others or a less exact request helps.",
}


def explain_refusal(refused: RefusedTurn) -> list[str]:
    """A few lines: the words, the reason, where it failed how often, and what may help."""
    lines = [f"refused: {refused['words']!r}", f"because: {refused['reason']}"]
    stages = Counter(each["stage"] for each in refused["rejections"])
    if sum(stages.values()) > 1:
        failures = [
            f"{count}x {_STAGES.get(stage, stage)}" for stage, count in stages.most_common()
        ]
        lines.append(f"it failed {', '.join(failures)}")
    details = Counter(each["detail"] for each in refused["rejections"])
    lines += [f"  {detail}" for detail, _ in details.most_common(3) if detail != refused["reason"]]
    if refused["code"] in _ADVICE:
        lines.append(_ADVICE[refused["code"]])
    return lines
