"""A later turn that changes an earlier plan: "from the east instead", "make it a collision"."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from scenewright.backends.builtin.clauses import ClauseReader
from scenewright.backends.builtin.clock import Clock
from scenewright.backends.builtin.context import read_context
from scenewright.backends.builtin.draft import AgentDraft, Draft, Refused, RelationDraft
from scenewright.backends.builtin.lexicon import Chunk, load_lexicon
from scenewright.backends.builtin.normalise import clean, split_tokens
from scenewright.scene.social import MOST_BACKGROUND

_CUE = re.compile(
    r"^\s*(?:then|and|next|afterwards|finally|ok|okay)\b|\b(instead|now|change|switch|"
    r"same (?:but|scene|thing|setup|again)|keep|actually|add|remove|drop|delete|swap|"
    r"replace|also|make (?:it|the|that|him|her|them|this|one)"
    r"|turn (?:it|that) into|set the|this time|what if|let the|have the|have it|let it|"
    r"should|more|less|busier|quieter|earlier|later|reverse|other way a?round|but|"
    r"without|move)\b"
)
_FULL = re.compile(r"\b(?:new scene|start over|from scratch|forget (?:that|it|the))\b")
_ADD = re.compile(r"\b(?:add|throw in|include|put in|insert)\b")


def is_edit(text: str) -> bool:
    """True if the text changes an earlier turn rather than describing a scene of its own."""
    plain = clean(text)
    if _FULL.search(plain):
        return False
    chunks = load_lexicon().split_chunks(split_tokens(plain))
    agents = [at for at, chunk in enumerate(chunks) if chunk.has("AGENT")]
    introduced = [at for at in agents if _is_indefinite(chunks, at)]
    relation = any(
        chunk.has("COLLIDE", "NEAR", "YIELD", "FOLLOW", "WAIT", "LET") for chunk in chunks
    )
    if relation and len(introduced) >= 2:
        return False
    return bool(_CUE.search(plain)) or len(agents) < 2


def apply(
    draft: Draft,
    chunks: Sequence[Chunk],
    read: Callable[[Sequence[Chunk]], ClauseReader],
    clock: Clock,
) -> None:
    """Change the draft in place as the chunks say."""
    text = " ".join(chunk.text for chunk in chunks)
    if any(chunk.tags.get("EDIT") == "swap" for chunk in chunks):
        _swap(draft)
        return
    rest = _add_agents(draft, chunks) if _ADD.search(text) else list(chunks)
    rest = _change_subtypes(draft, rest)
    if "instead" in text:
        rest = [_make_definite(chunk) for chunk in rest]
    if _remove_agents(draft, chunks):
        return
    earlier = list(draft.relations)
    draft.relations.clear()
    agents = list(draft.agents)
    read(rest)
    _replace_relations(draft, earlier, rest, known=agents)
    read_context(draft, chunks, clock)
    _forget(draft)


def _is_indefinite(chunks: Sequence[Chunk], at: int) -> bool:
    for chunk in reversed(chunks[max(0, at - 4) : at]):
        if chunk.has("AGENT") or chunk.mark:
            return False
        if chunk.has("DET"):
            return chunk.tags["DET"] in {"indefinite", "another"}
    return False


def _make_definite(chunk: Chunk) -> Chunk:
    """ "a car from the south instead" speaks of the car that is there."""
    indefinite = chunk.tags.get("DET") == "indefinite"
    return Chunk(("the",), {"DET": "definite"}) if indefinite else chunk


def _remove_agents(draft: Draft, chunks: Sequence[Chunk]) -> bool:
    """ "remove the pedestrian": the agent goes, and every relation it had."""
    at = next((i for i, chunk in enumerate(chunks) if chunk.tags.get("EDIT") == "remove"), None)
    named = (
        None if at is None else next((c for c in chunks[at + 1 : at + 4] if c.has("AGENT")), None)
    )
    if named is None or any(chunk.has("NOBODY", "NEGATION") for chunk in chunks):
        return False
    gone = _change_agent(draft, [named])
    if gone is None:
        return False
    draft.agents.remove(gone)
    draft.relations[:] = [r for r in draft.relations if gone not in (r.from_, r.to)]
    return True


def _swap(draft: Draft) -> None:
    for relation in draft.relations:
        relation.from_, relation.to = relation.to, relation.from_


def _add_agents(draft: Draft, chunks: Sequence[Chunk]) -> list[Chunk]:
    """Counted agents after "add" join the background; the rest is read on."""
    rest: list[Chunk] = []
    number: int | None = None
    for chunk in chunks:
        if chunk.has("NUMBER"):
            number = int(chunk.tags["NUMBER"])
        elif chunk.has("AGENT") and (number is not None):
            _change_count(draft, chunk, number)
            number = None
        elif not chunk.has("DET", "BACKGROUND", "EDIT"):
            rest.append(chunk)
    return rest


def _change_count(draft: Draft, chunk: Chunk, number: int) -> None:
    context = draft.context
    pedestrian = chunk.tags["AGENT"].startswith("pedestrian")
    total = ((context.pedestrians if pedestrian else context.vehicles) or 0) + number
    if total > MOST_BACKGROUND:
        raise Refused(
            "impossible",
            f"{total} background agents are too many; ask for at most {MOST_BACKGROUND}.",
        )
    if pedestrian:
        context.pedestrians = total
    else:
        context.vehicles = total


def _change_subtypes(draft: Draft, chunks: Sequence[Chunk]) -> list[Chunk]:
    """ "make one of them a bus", "replace the car with a truck": the vehicle changes its kind."""
    text = " ".join(chunk.text for chunk in chunks)
    if not re.search(r"\b(?:make|replace|change|turn|switch|should be)\b", text):
        return list(chunks)
    named = [at for at, chunk in enumerate(chunks) if chunk.has("AGENT")]
    if not named or not _is_indefinite(chunks, named[-1]):
        return list(chunks)
    if any(chunk.has("COLLIDE", "NEAR", "YIELD", "FOLLOW", "LET", "WAIT") for chunk in chunks):
        return list(chunks)
    target = _change_agent(draft, chunks[: named[-1]])
    kind, _, subtype = chunks[named[-1]].tags["AGENT"].partition(".")
    if target is None or (kind == "pedestrian") != (target.type == "pedestrian"):
        return list(chunks)
    target.subtype, target.head = subtype or None, chunks[named[-1]].text
    opened = max(at for at in range(named[-1]) if chunks[at].has("DET"))
    said = chunks[opened + 1 : named[-1]]
    known = [Chunk(("the",), {"DET": "definite"}), chunks[named[-1]]]
    start = _find_phrase_start(chunks, named[0])
    return [*chunks[:start], *known, *said, *chunks[named[-1] + 1 :]]


def _find_phrase_start(chunks: Sequence[Chunk], at: int) -> int:
    while at > 0 and (chunks[at - 1].has("DET", "NUMBER") or chunks[at - 1].text in {"of", "one"}):
        at -= 1
    return at


def _change_agent(draft: Draft, chunks: Sequence[Chunk]) -> AgentDraft | None:
    for chunk in reversed(chunks):
        if chunk.has("AGENT"):
            same = [a for a in draft.agents if a.head == chunk.text] or [
                a for a in draft.agents if chunk.tags["AGENT"].startswith(a.type)
            ]
            return same[0] if same else None
    vehicles = [agent for agent in draft.agents if agent.type == "vehicle"]
    return vehicles[-1] if vehicles else None


def _replace_relations(
    draft: Draft, earlier: list[RelationDraft], chunks: Sequence[Chunk], *, known: list[AgentDraft]
) -> None:
    """A relation said anew takes the place of the old one of the same agents."""
    said = list(draft.relations)
    if not said and draft.normal is False and any(chunk.has("NORMAL") for chunk in chunks):
        return
    if len(draft.agents) > len(known) and said and earlier and _is_only_implied(said, known):
        draft.agents[:] = known
        said = [RelationDraft(said[0].type, earlier[0].from_, earlier[0].to, said[0].kind)]
    pairs = {relation.pair() for relation in said}
    kept = [relation for relation in earlier if relation.pair() not in pairs]
    draft.relations[:] = kept + said


def _is_only_implied(said: list[RelationDraft], known: list[AgentDraft]) -> bool:
    return (
        len(said) == 1
        and not (said[0].from_ in known and said[0].to in known)
        and not said[0].from_.head
        and not said[0].to.head
    )


def _forget(draft: Draft) -> None:
    """What an edit changed no longer binds what followed from the old value."""
    for agent in draft.agents:
        agent.edited.clear()
