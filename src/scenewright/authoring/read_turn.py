"""Words -> what they amount to: by the builtin planner, or by the language model that plans."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from scenewright.backends import Account, Backend, get_backend_of_task, ignore_account
from scenewright.backends.offline import CLASSES, Patterns
from scenewright.errors import BackendFault
from scenewright.scene.edits import (
    AgentView,
    Choice,
    Clarification,
    DeclinedTurn,
    Reading,
    Situation,
)
from scenewright.scene.frozen_agents import PreviousVersion
from scenewright.scene.map import IntersectionMap
from scenewright.scene.phrasing import call_agents
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.scene.social import Refusal, SocialGraph

_PATTERNS = Patterns("read_turn")


def build_situation(graph: SocialGraph, record: SceneRecord, earlier: PreviousVersion) -> Situation:
    """The situation that words are read against: the social graph and the agents."""
    called, same = call_agents(record), AgentView.model_fields.keys() & AgentRecord.model_fields
    present = []
    for each in record.agents:
        agent = earlier.agents[each.name].agent
        view = {key: getattr(each, key) for key in same} | {
            "id": each.name, "number": each.id, "called": called[each.id],
            "speed": agent.candidate.time_law.speed, "stops": bool(agent.stands),
            "slows_to": min((stop.speed for stop in agent.stops if stop.rolls), default=None),
        }  # fmt: skip
        present.append(AgentView.model_validate(view))
    return Situation(graph=graph, present=tuple(present))


def read_words(
    words: str,
    situation: Situation | None,
    *,
    backend: Backend,
    before: str | None,
    chosen: Mapping[str, str],
    intersection_map: IntersectionMap,
    seed: int,
    account: Account = ignore_account,
) -> Reading:
    """What the words amount to: as the planner reads them, by rule where it is the builtin one.

    What the session itself does, such as undoing, and words that say they begin a new scene are
    read by rule with any planner; so is what the planner had no useful reading of.

    Args:
        before: what was said so far.
        chosen: answers to questions about the words: phrase -> agent id.
        account: called with what every answer of a model has cost.
    """
    from scenewright.backends.offline import begins_anew, build_site, read

    by_rule = read(words, situation, chosen=chosen, site=build_site(intersection_map))
    asked = not get_backend_of_task(backend, "edits").deterministic
    if situation is None or begins_anew(words) or not asked:
        return by_rule
    from scenewright.nodes.revision import Turn, read_by_model
    from scenewright.nodes.scene_planner import describe_routes

    turn = Turn(
        words,
        situation,
        before or "",
        describe_routes(intersection_map),
        chosen,
        left_hand=intersection_map.left_hand_traffic,
    )
    try:
        reading = read_by_model(turn, backend=backend, seed=seed, account=account)
    except BackendFault as fault:
        return DeclinedTurn(code="backend_failed", reason=str(fault))
    return by_rule if reading is None else reading


SENTENCE = "sentence"
"""Marker of a choice between sentences, in place of a phrase."""


_NOTHING = "Nothing happens"
"""In an offered sentence without an event."""
_MOST_PARTS = 6
_NARRATOR = re.compile(
    r"\b(?:i|my|we)(?:'m| am| was)?(?: [a-z]+){0,4}? (?P<noun>"
    + "|".join(sorted(CLASSES, key=len, reverse=True)) + r")\b"
)  # fmt: skip


def find_narrator(words: str) -> str | None:
    """The noun of what the one who writes drives or is, as in "I am a taxi driver"."""
    found = _NARRATOR.search(words.lower())
    return None if found is None else found["noun"]


def ask_what_is_meant(words: str, intersection_map: IntersectionMap) -> Clarification | None:
    """A question with the sentences that the offline planner takes doubtful words to mean.

    Of words that it cannot read as a whole, a part that it can is offered, and said to be a part.
    """
    from scenewright.backends.offline import build_site, plan
    from scenewright.tools.map_grounding.grounding import can_ground

    serves = partial(can_ground, intersection_map=intersection_map)
    site = replace(build_site(intersection_map), can_serve=serves)
    found = plan(words, site=site)
    if not isinstance(found, Refusal):
        return None
    reason = found.reason.partition(" Did you mean")[0]
    offers = [(reason, found.did_you_mean)] if found.did_you_mean else []
    if not offers or _measure_cover(found.did_you_mean[0], words) < _measure_cover(words, words):
        for part in _list_parts(words):
            read = plan(part, site=site)
            sentences = read.did_you_mean if isinstance(read, Refusal) else (part.strip(" .!?;:"),)
            if sentences and bool(_list_classes(sentences[0])) >= bool(_list_classes(words)):
                offers.append(("I could not read all of that.", sentences))
    if not offers:
        return None
    return offer_sentences(*max(offers, key=lambda each: _measure_cover(each[1][0], words)))


def _measure_cover(sentence: str, words: str) -> int:
    """How much of what the words name a sentence has: road users, and that something happens."""
    tells = all(_PATTERNS.tells_event.search(each.lower()) for each in (words, sentence))
    happens = tells and _NOTHING not in sentence
    return len(_list_classes(words) & _list_classes(sentence)) + 2 * happens


def _list_classes(text: str) -> set[tuple[str, str | None]]:
    """The classes of the road users that a text names."""
    nouns = (each.removesuffix("s") for each in re.findall(r"[a-z-]+", text.lower()))
    return {CLASSES[noun] for noun in nouns if noun in CLASSES}


def offer_sentences(what: str, sentences: Sequence[str]) -> Clarification:
    """A question with sentences to choose from."""
    numbered = list(enumerate(sentences, start=1))
    choices = [Choice(answer=str(k), means=f"{SENTENCE}={each}") for k, each in numbered]
    listed = " ".join(f"{k}: {each}" for k, each in numbered)
    return Clarification(
        question=f"{what} Do you mean {listed} 0: none of these",
        choices=(*choices, Choice(answer="0", means=f"{SENTENCE}=")),
    )


def _list_parts(words: str) -> list[str]:
    """Sentences of the words, the last ones together first; "me" is who says so of herself."""
    noun, said = find_narrator(words), words
    if noun is not None:
        article = "an" if noun[0] in "aeiou" else "a"
        said = re.sub(r"\bme\b", f"{article} {noun}", words, count=1)
    sentences = [each for each in _PATTERNS.sentences.split(said) if len(each.split()) > 2]
    together = [" ".join(sentences[k:]) for k in range(len(sentences))]
    parts = [each for each in dict.fromkeys([*together, *sentences]) if each != words]
    return parts[:_MOST_PARTS]
