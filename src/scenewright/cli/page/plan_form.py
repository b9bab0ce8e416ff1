"""The plan as a form beside the words: read from the page, and described for it."""

from __future__ import annotations

from typing import Any

from scenewright.errors import InputError
from scenewright.graph.run import check_plan
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.plan_file import PlanFile, compute_digest, read_plan


def read_plan_object(given: Any, intersection: str | None = None) -> PlanFile:
    """The plan in an object of the page, with ways for its agents where a place is named.

    Raises:
        InputError: it is none; names the field.
    """
    if not isinstance(given, dict):
        raise InputError("a plan is an object with its fields")
    found = read_plan(given)
    if intersection is not None:
        check_plan(found, intersection=intersection)
    return found


def describe_plan_file(found: PlanFile) -> dict[str, Any]:
    """The fields that are set, as a plan file has them, and the plan in words."""
    fields = found.plan.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    words = found.text if found.as_read else describe_graph(found.plan)
    if found.text:
        fields["text"] = found.text
    if found.as_read:
        fields["read_as"] = compute_digest(found.plan, found.text)
    return {"plan": fields, "words": words}
