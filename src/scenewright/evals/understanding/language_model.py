"""The language model's part: it reads the scene in words and answers in names that exist."""

from __future__ import annotations

from typing import Any, Literal, cast

from pydantic import BaseModel, Field, create_model, model_validator

from scenewright.backends import Backend, Prompt, Question, Task
from scenewright.errors import InputError
from scenewright.evals.understanding.labels import PairRelation
from scenewright.evals.understanding.scene_description import SceneDescription
from scenewright.nodes.ask import ask
from scenewright.scene.base import Model

TASK: Task = "plan"
"""Where stages have backends of their own, the planner's answers."""
SYSTEM = """You watch a traffic intersection and say early what will happen.
You are told the map, the lights, who has been seen so far, where first and where now, and how they
move, what a statistical model thinks about where they leave, and what a rule checker finds in
predicted tracks.

Answer with one JSON object:
- "exits": for every agent the side of the map towards which it will eventually leave.
- "relations": every relation between two agents that you expect, often none:
  - "collision": they will touch; order does not matter.
  - "yielding": "from" slows down or stops to let "to" pass first, then goes on.
  - "near_miss": they pass within a second and a half of one another without touching.
Most agents have none. A red light is no yielding. Use only the names given."""


class _NamedRelation(Model):
    """A relation in names; the subclass made for a scene knows which."""

    type: Literal["collision", "yielding", "near_miss"]
    from_: str = Field(alias="from")
    to: str

    @model_validator(mode="after")
    def _check_distinct(self) -> _NamedRelation:
        if self.from_ == self.to:
            raise ValueError(f"{self.from_} cannot have a relation with itself")
        return self


def build_reply_model(names: tuple[str, ...], sides: tuple[str, ...]) -> type[BaseModel]:
    """Build the reply model for one scene: agents and sides are enumerations of what exists."""
    side: Any = Literal[sides]
    name: Any = Literal[names]
    fields: dict[str, Any] = dict.fromkeys(names, (side, ...))
    exits = create_model("Exits", __base__=Model, **fields)
    relation = create_model(
        "Relation", __base__=_NamedRelation, from_=(name, Field(alias="from")), to=(name, ...)
    )
    relations: Any = tuple[relation, ...]  # type: ignore[valid-type]
    return create_model("Reply", __base__=Model, exits=(exits, ...), relations=(relations, ...))


def ask_about_scene(
    description: SceneDescription,
    sides: tuple[str, ...],
    backend: Backend,
    *,
    rejections: tuple[str, ...] = (),
) -> tuple[dict[str, str], tuple[PairRelation, ...]]:
    """Ask for exits and relations; the answer is in ids.

    Raises:
        Rejected: the reply names what does not exist or misses an agent.
        BackendFault: no answer can be had.
    """
    ids = {name: code for code, name in description.names.items()}
    names = tuple(ids)
    model = build_reply_model(names, sides)
    refused = [f"Your earlier answer was refused: {each[:400]}" for each in rejections[-3:]]
    user = "\n".join([description.text, *refused])
    question = Question(
        task=TASK,
        facts={"scene": description.text, "agents": list(names), "sides": list(sides)},
        rejections=rejections,
        seed=0,
        prompt=lambda: Prompt(SYSTEM, user, model.model_json_schema()),
    )
    reply = cast(Any, ask(backend, question, model, stage="scene_planner"))
    exits = {ids[name]: str(getattr(reply.exits, name)) for name in names}
    relations = [PairRelation(r.type, ids[r.from_], ids[r.to]) for r in reply.relations]
    return exits, tuple({each.key: each for each in relations}.values())


def require_language_model(backend: Backend) -> Backend:
    """Return the backend unless it is the builtin planner, which cannot read scenes.

    Raises:
        InputError: it is.
    """
    if backend.name == "builtin":
        raise InputError(
            "the method agent asks a language model, which builtin is not; name one with "
            "--backend, such as openai:MODEL"
        )
    return backend
