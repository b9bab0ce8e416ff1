"""The language model's part: it reads the scene in words and answers in names that exist."""

from __future__ import annotations

from typing import Any, Literal, cast

from pydantic import BaseModel, Field, create_model, model_validator

from scenewright.backends import Backend, Question, Task, Wording
from scenewright.errors import InputError
from scenewright.evals.understanding.labels import Relation
from scenewright.evals.understanding.words import Description
from scenewright.nodes.ask import ask
from scenewright.scene.base import Model

TASK: Task = "plan"
"""The questions of a run are the planner's to answer where stages have speakers of their own."""
SYSTEM = """You watch a traffic intersection and say early what will happen.
You are told the map, the lights, who has been seen so far with where they came from and how they
move, what a statistical model thinks about where they leave, and what a rule checker finds in
predicted tracks.

Answer with one JSON object:
- "exits": for every agent the side of the map towards which it will eventually leave.
- "relations": every relation between two agents that you expect, often none:
  - "collision": they will touch; order does not matter.
  - "yielding": "from" slows down or stops to let "to" pass first, then goes on.
  - "near_miss": they pass within a second and a half of one another without touching.
Most agents have none. A red light is no yielding. Use only the names given."""


class _Named(Model):
    """A relation in names; the subclass made for a scene knows which."""

    type: Literal["collision", "yielding", "near_miss"]
    from_: str = Field(alias="from")
    to: str

    @model_validator(mode="after")
    def _two(self) -> _Named:
        if self.from_ == self.to:
            raise ValueError(f"{self.from_} cannot have a relation with itself")
        return self


def reply_model(names: tuple[str, ...], sides: tuple[str, ...]) -> type[BaseModel]:
    """The reply for one scene: agents and sides are enumerations of what exists."""
    side: Any = Literal[sides]
    name: Any = Literal[names]
    fields: dict[str, Any] = dict.fromkeys(names, (side, ...))
    exits = create_model("Exits", __base__=Model, **fields)
    relation = create_model(
        "Relation", __base__=_Named, from_=(name, Field(alias="from")), to=(name, ...)
    )
    listed: Any = tuple[relation, ...]  # type: ignore[valid-type]
    return create_model("Reply", __base__=Model, exits=(exits, ...), relations=(listed, ...))


def ask_about(
    told: Description,
    sides: tuple[str, ...],
    backend: Backend,
    *,
    rejections: tuple[str, ...] = (),
    seed: int = 0,
) -> tuple[dict[str, str], tuple[Relation, ...]]:
    """Exits and relations by code, as the backend answers.

    Raises:
        Rejected: the reply names what is not there or misses somebody.
        BackendFault: no answer can be had.
    """
    names = tuple(told.names.values())
    model = reply_model(names, sides)
    wording = Wording(SYSTEM, _user(told, rejections), model.model_json_schema())
    question = Question(
        task=TASK,
        facts={"scene": told.text, "agents": list(names), "sides": list(sides)},
        rejections=rejections,
        seed=seed,
        wording=lambda: wording,
    )
    reply = cast(Any, ask(backend, question, model, stage="scene_planner"))
    codes = {name: code for code, name in told.names.items()}
    exits = {codes[name]: str(getattr(reply.exits, name)) for name in names}
    found = {
        relation.key: relation
        for each in reply.relations
        for relation in (Relation(each.type, codes[each.from_], codes[each.to]),)
    }
    return exits, tuple(found.values())


def speaks(backend: Backend) -> Backend:
    """The backend, unless it is the grammar, which cannot read scenes.

    Raises:
        InputError: it is.
    """
    if backend.name == "builtin":
        raise InputError(
            "the method agent asks a language model, which builtin is not; name one with "
            "--backend, such as openai:MODEL"
        )
    return backend


def _user(told: Description, rejections: tuple[str, ...]) -> str:
    wrong = [f"Your earlier answer was refused: {each[:400]}" for each in rejections[-3:]]
    return "\n".join([told.text, *wrong])
