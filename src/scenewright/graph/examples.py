"""Accepted scenes as examples for prompts."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import ValidationError

from scenewright.memory.episodes import Episodes
from scenewright.nodes.prompts import MOST_EXAMPLES, Example, ExampleRetriever
from scenewright.scene.social import SocialGraph


def recall_from(episodes: Episodes) -> ExampleRetriever:
    """Recalls for the planner; the other stages' answers depend on more than the request."""

    def recall(task: str, instruction: str) -> Sequence[Example]:
        found = []
        for each in episodes.recall(instruction, MOST_EXAMPLES) if task == "plan" else ():
            try:
                graph = SocialGraph.model_validate(dict(each.graph))
            except ValidationError:
                continue  # the file is untrusted data
            plain = graph.model_dump(mode="json", by_alias=True, exclude_defaults=True)
            found.append(Example(each.request, plain))
        return found

    return recall
