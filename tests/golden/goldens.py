"""Texts that are kept to be looked at. `python tests/golden/goldens.py` writes them anew."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import prompts

FOLDER = Path(__file__).parent


def graph_as_mermaid() -> str:
    """The state machine with every retry edge."""
    from scenewright.graph.build import build_graph

    return build_graph().compile().get_graph().draw_mermaid()


GOLDENS: dict[str, Callable[[], str]] = {
    "graph.mmd": graph_as_mermaid,
    "prompt_plan.txt": lambda: prompts.as_text(prompts.plan()),
    "prompt_constraints.txt": lambda: prompts.as_text(prompts.constraints()),
    "prompt_behavior.txt": lambda: prompts.as_text(prompts.behavior()),
    "prompt_edits.txt": lambda: prompts.as_text(prompts.edits()),
}

if __name__ == "__main__":
    for name, text in GOLDENS.items():
        (FOLDER / name).write_text(text(), encoding="utf-8")
