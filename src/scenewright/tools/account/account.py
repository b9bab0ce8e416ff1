"""The account: a state for every content word of the texts, and the verdict of the whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, groupby
from typing import NamedTuple

from scenewright.scene.account import AccountEntry, WordState
from scenewright.scene.events import Finding, Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.plan_fields import join_fields, list_fields
from scenewright.scene.record import SceneRecord
from scenewright.tools.account.binding import bind_mentions
from scenewright.tools.account.claims import Binding, Claim, Result
from scenewright.tools.account.facts import SceneFacts
from scenewright.tools.account.field_claims import account_fields
from scenewright.tools.account.mentions import Mention, find_mentions
from scenewright.tools.account.roads import name_roads
from scenewright.tools.account.sense_readers import read_claims
from scenewright.tools.account.talk import is_talk
from scenewright.tools.account.vocabulary import Token, is_label, load_vocabulary, read_tokens
from scenewright.tools.relation_checker import check
from scenewright.tools.relation_checker.clock import is_within

_STANDS = ("place", "crosswalk", "adverb", "stands", "request", "unit", "change")
_TURNS_MEANING = ("negation", "sequence", "order", "beyond.part")
"""Senses of function words that turn a meaning, which are content (SEMANTICS 9)."""
_DECISIVE = ("kind", "object")
"""Types of which one that fails outweighs whatever else holds of the word."""
_STRICT = (*_DECISIVE, "red_light", "event", "side", "heading", "movement", "crossing", "tie")
"""Types of which one that fails outweighs what only holds of nearly every scene."""
_WEAK = ("phrase", "moves", "crosswalk", "crossing", "light")
"""Types that hold of nearly every scene."""
_EITHER_WAY = (*_WEAK, "kind", "manoeuvre")
"""Types that also hold where roles are exchanged."""
_DENIABLE = ("normal", "stop", "brake", "red", "reaction", "beyond", "background", "noun",
             "avoid", "manner", "crosswalk", "jaywalking", "turn", "order", "light", "sight",
             "event")  # fmt: skip
"""Senses of words that a negation, or "almost", may belong to."""
_RELATIVE = ("count", "stop", "braking", "density", "background", "order", "pace")
"""Types of claims that a change may make of how it was before: "half a metre earlier"."""
_NOT_SHOWN = "no claim covers it"
_BEYOND = {
    "animal": "animals are not shown", "rail": "trams and trains are not shown",
    "vehicle": "road users of this kind are not shown", "place": "the place is not shown",
    "object": "objects of this kind are not shown", "weather": "weather is not shown",
    "sound": "sounds are not shown", "gesture": "gestures are not shown",
    "harm": "nothing tests it on tracks", "track": "nothing measures it on tracks",
    "part": "nothing tests who is left out",
}  # fmt: skip


_MOMENTS = ("same", "time", "moment", "simultaneously", "once")
"""Words of phrases that say that two things happen at once, "arrive at the same time"."""


class _Judged(NamedTuple):
    """State of a word, with its claim, the evidence and the agents in it."""

    state: WordState
    claim: str | None = None
    evidence: str = ""
    agents: tuple[int, ...] = ()


_ANYWAY = _Judged("stands_anyway", evidence="true of every scene made here")
_NAMES_FIGURE = _Judged("stands_anyway", evidence="says what a figure is of")


def prove(
    scene: SceneRecord, intersection_map: IntersectionMap | None = None, *, labelled: bool = False
) -> Proof:
    """The checker's proof of a scene with the account of its texts.

    Args, raises: as `relation_checker.check`.
    """
    return write_account(scene, check(scene, intersection_map, labelled=labelled), intersection_map)


def write_account(
    scene: SceneRecord, proof: Proof, intersection_map: IntersectionMap | None
) -> Proof:
    """The proof with a state for each content word of the scene's texts, or field of its plan.

    A contradicted word, or an event that was made though no word asks for it, is a finding.
    """
    if scene.meta.rules is None or scene.meta.driven_by is not None:
        return proof
    texts = scene.meta.texts
    facts = SceneFacts(scene, proof, intersection_map)
    if scene.meta.plan is None:
        words = [e for turn, text in enumerate(texts) for e in _account_text(text, turn, facts)]
        entries = _drop_replaced(words, texts)
    else:
        entries = list(
            account_fields(scene.meta.plan, facts, lambda text: _account_text(text, 0, facts))
        )
    false = tuple(
        Finding(
            rule="word_contradicted",
            agents=entry.agents,
            detail=f"'{entry.words}' says {entry.claim}; the scene shows {entry.evidence}",
        )
        for entry in entries
        if entry.state == "contradicted"
    )
    if (plan := scene.meta.plan) and scene.meta.user_prompt != join_fields(list_fields(plan)):
        detail = "the prompt does not list the fields of the plan"
        false += (Finding(rule="metadata_contradicted", agents=(), detail=detail),)
    return proof.model_copy(
        update={
            "account": tuple(entries),
            "missing": (*proof.missing, *false),
            "verified": proof.verified and not false,
        }
    )


def _drop_replaced(entries: list[AccountEntry], texts: Sequence[str]) -> list[AccountEntry]:
    """The entries without earlier words that a later text takes back or replaces.

    In a change, words of what was there before ("the van" that is to be a bus) are no claims.
    """
    back = [any(token.is_in("takes_back") for token in read_tokens(text)) for text in texts]
    compares = [any(token.is_in("compares") for token in read_tokens(text)) for text in texts]
    kept: list[AccountEntry] = []
    for entry in entries:
        kind = _get_type(entry)
        said = entry.claim is not None or entry.words[:1].isdecimal()
        if entry.state in ("contradicted", "not_shown") and said:
            changed = {_get_type(e) for e in entries if e.turn > entry.turn and e.state == "seen"}
            changed |= (
                {"event"} if "order" in changed else set()
            )  # who goes first gives way no more
            if kind in changed or any(back[entry.turn + 1 :]):
                continue
            before = {e.words.lower() for e in entries if e.turn < entry.turn}
            if kind in ("class", "count", "object") and entry.words.lower() in before:
                reason = {"state": "stands_anyway", "evidence": "what was there before"}
                entry = entry.model_copy(update=reason)  # noqa: PLW2901
        by_how_much = texts[entry.turn][entry.end : entry.end + 20].lower().split()[:1]
        relative = entry.turn and (
            kind in ("", *_RELATIVE)
            if not any(sign.isdecimal() for sign in entry.words)
            else bool(by_how_much) and by_how_much[0] in load_vocabulary().lists["compares"]
        )
        if entry.state in ("contradicted", "not_shown") and relative and compares[entry.turn]:
            reason = {"state": "stands_anyway", "evidence": "a change to what was there before"}
            entry = entry.model_copy(update=reason)  # noqa: PLW2901
        kept.append(entry)
    return kept


def _get_type(entry: AccountEntry) -> str:
    return (entry.claim or "").partition(" ")[0]


def list_unknown_words(
    text: str, intersection_map: IntersectionMap | None
) -> tuple[AccountEntry, ...]:
    """The words of a text that no scene at a place can show, whatever is planned."""
    tokens = name_roads(read_tokens(text), text, intersection_map)
    return tuple(
        _build_entry(text, 0, tokens[n : n + 1], _Judged("not_shown", evidence=reason))
        for n, token in enumerate(tokens)
        if not (is_function(token) or _names_road(token, intersection_map))
        and (reason := _find_unknown(tokens, n)) is not None
    )


def _find_unknown(tokens: Sequence[Token], n: int) -> str | None:
    """Why nothing can show a word; None where something may."""
    token = tokens[n]
    says_nothing = token.number is not None or token.text.endswith("ly")
    if token.kind != "word" or says_nothing or _names_number(tokens, n):
        return None
    families = token.list_families()
    if families == {"beyond"} and not token.phrase and not _is_denied(tokens, n):
        return _BEYOND[token.list_values("beyond")[0]]
    return None if families or token.phrase or is_talk(tokens, n) else _NOT_SHOWN


def _is_denied(tokens: Sequence[Token], n: int) -> bool:
    """Whether a negation belongs to a noun or verb: "without rain", "does not honk"."""
    for token in reversed(tokens[max(0, n - 4) : n]):
        if token.kind in ("end", "comma") or token.text in ("a", "an", "the", "and", "but"):
            return False
        if token.negates:
            return True
    return False


def _names_number(tokens: Sequence[Token], n: int) -> bool:
    """Whether a word says what the number after it is of, which says nothing: "Ref 24-118"."""
    return tokens[n].is_in("numbered") and n + 1 < len(tokens) and is_label(tokens, n + 1)


def _is_stop(token: Token) -> bool:
    return token.kind in ("end", "comma", "arrow")


def is_function(token: Token) -> bool:
    """Whether a word has no content of its own."""
    function = load_vocabulary().function
    if _is_stop(token):
        return True
    turns_meaning = token.has(*_TURNS_MEANING) and len(token.text) > 2
    return not turns_meaning and not function.isdisjoint((token.text, token.text.partition("'")[0]))


def _account_text(text: str, turn: int, facts: SceneFacts) -> Iterator[AccountEntry]:
    tokens = name_roads(read_tokens(text), text, facts.intersection_map)
    mentions = find_mentions(tokens)
    claims = read_claims(tokens, mentions)
    binding, results = bind_mentions(mentions, claims, facts)
    by_token: dict[int, list[tuple[Claim, Result]]] = {}
    for claim, result in zip(claims, results, strict=True):
        for n in claim.tokens:
            by_token.setdefault(n, []).append((claim, result))
    latest = turn == len(facts.scene.meta.texts) - 1
    head = mentions[0].head if mentions and mentions[0].pronoun else None
    if turn == 0 and head is not None and tokens[head].is_in("needs_antecedent"):
        by_token[head] = []  # "one of them" as the first words names no road user
    for index in _find_repeated(mentions, binding, facts) if latest else ():
        nouns, false = mentions[index].nouns, Result(False, "one agent in place of two")
        claim = Claim("class", "a road user of its own", nouns, (), lambda *_: Result(False))
        for n in nouns:
            by_token[n] = [(claim, false)]
    states = [_judge(n, tokens, by_token.get(n, []), facts) for n in range(len(tokens))]
    for n in reversed(range(len(tokens))):
        found = states[n]
        turns = tokens[n].negates or tokens[n].has("almost", "avoid")
        turns = turns and not tokens[n].has("reaction")  # "dodges" is a motion of its own
        event = tokens[n].has("event") and not tokens[n].has("almost")
        followed = any(token.has("event") for token in tokens[n + 1 : n + 3])
        own = found is not None and (found.state == "seen" or (found.claim and (event or followed)))
        if turns and not own:
            states[n] = _copy_near(states, tokens, n)
    shown = list(states)
    for n, (token, found) in enumerate(zip(tokens, states, strict=True)):
        turns_meaning = token.negates or token.has("sequence")
        if found and found.state != "seen" and is_function(token) and not turns_meaning:
            shown[n] = None
    for found, same in groupby(range(len(tokens)), key=lambda n: shown[n]):
        if found is not None:
            span = list(same)
            yield _build_entry(text, turn, tokens[span[0] : span[-1] + 1], found)


def _find_repeated(
    mentions: Sequence[Mention], binding: Binding, facts: SceneFacts
) -> Iterator[int]:
    """Mentions without an article for an agent told of before, while another is not told of."""
    asked = {n for r in facts.scene.relations for n in (r.from_, r.to) if n in facts.foreground}
    mentioned = set().union(*binding.values()) if binding else set()
    known: set[int | str] = set()
    for index, mention in enumerate(mentions):
        if mention.pronoun or mention.definite or mention.label:
            continue
        bound = binding.get(index, frozenset())
        if len(bound) == 1 and bound <= known and asked - mentioned:
            yield index
        known |= bound


def _judge(
    n: int, tokens: Sequence[Token], found: Sequence[tuple[Claim, Result]], facts: SceneFacts
) -> _Judged | None:
    """The state of a word by the results of its claims; None where it needs no state."""
    token = tokens[n]
    if _is_stop(token) or is_label(tokens, n) or _names_number(tokens, n):
        return None
    held = [each for each in found if each[1].holds]
    false = [each for each in found if each[1].holds is False]
    strict = [each for each in false if each[0].type in _STRICT]
    if any(claim.type == "phrase" for claim, _ in held):  # the phrase says it, not a word of it
        strict = [each for each in strict if each[0].type != "event"]
    decided = any(claim.type in _DECISIVE for claim, _ in false)
    weak = all(claim.type in _EITHER_WAY for claim, _ in held)
    own = [result for claim, result in found if claim.type in ("motion", "manoeuvre")]
    broad = bool(own) and token.is_in("specific") and not any(each.holds for each in own)
    if held and not (decided or broad or (strict and weak)):
        claim, result = min(held, key=lambda e: (e[0].type in _WEAK, e[0].type != "kind"))
        return _Judged("seen", f"{claim.type} {claim.value}", result.evidence, result.agents)
    if is_function(token):
        return None
    if not false and _names_road(token, facts.intersection_map):
        return _Judged("seen", "road", "a street of this place")
    return (
        _judge_beyond(n, tokens)
        or _judge_place(token, facts)
        or _judge_claims(tokens, n, found, strict or false)
    )


def _judge_beyond(n: int, tokens: Sequence[Token]) -> _Judged | None:
    """The state of a word for what no scene can show; None of another word."""
    families = tokens[n].list_families()
    if "beyond" not in families or "manner" in families:
        return None
    if _is_denied(tokens, n):
        return _Judged("stands_anyway", evidence="no scene made here has it")
    reason = _BEYOND[tokens[n].list_values("beyond")[0]]
    return _Judged("not_shown", evidence=reason) if families == {"beyond"} else None


def _judge_place(token: Token, facts: SceneFacts) -> _Judged | None:
    """Contradicted, where what is said of every scene is false of this one."""
    own = facts.scene.meta.time_of_day
    reason = None
    if token.is_in("with_lights") and not facts.scene.signals:
        reason = "a place without lights"
    elif token.is_in("by_day") and not is_within(own, "05:00-21:30"):
        reason = f"a scene at {own}"
    if reason is None or "stands" not in token.list_families():
        return None
    return _Judged("contradicted", token.text, reason)


def _judge_claims(
    tokens: Sequence[Token],
    n: int,
    found: Sequence[tuple[Claim, Result]],
    false: Sequence[tuple[Claim, Result]],
) -> _Judged | None:
    """The state of a content word of which no claim holds.

    Args:
        false: those of its claims that are false, the gravest ones alone.
    """
    token, begins = tokens[n], n == 0 or _is_stop(tokens[n - 1])
    families = token.list_families()
    grave = [each for each in false if each[0].type in (*_STRICT, "crosswalk")]
    limit = token.unit is not None and not found
    figure = token.number is not None and "number" in {claim.type for claim, _ in found}
    if (limit or not families.isdisjoint(_STANDS)) and not (grave or figure):
        return _NAMES_FIGURE if "unit" in families else _ANYWAY
    if not grave and ("manner" in families or (token.text.endswith("ly") and not families)):
        return _Judged("manner", evidence="tracks cannot speak of it")
    if false:
        claim, result = (grave or false)[0]
        return _Judged("contradicted", f"{claim.type} {claim.value}", result.evidence)
    if token.text in ("let", "have") and not found:
        return _ANYWAY
    lists = begins and families == {"order"} and token.text in ("first", "last", "second")
    if lists or (token.has("sequence") and token.text not in _MOMENTS):
        return None  # it joins no two events and orders no two road users
    unknown = token.kind == "word" and not (found or families or token.phrase)
    if unknown and is_talk(tokens, n):
        return _Judged("manner", evidence="says nothing that tracks could show")
    return _Judged("not_shown", evidence=_NOT_SHOWN)


def _copy_near(states: Sequence[_Judged | None], tokens: Sequence[Token], n: int) -> _Judged | None:
    """The state of the words that a negation or "almost" belongs to, mostly those after it."""
    after, before = range(n + 1, min(len(tokens), n + 7)), range(n - 1, max(-1, n - 5), -1)
    for m in chain(after, before):
        each = states[m]
        if tokens[m].kind == "end" or each is None:
            continue
        if not (each.claim or "").startswith("moves") and tokens[m].has(*_DENIABLE):
            return each
    following = states[n + 1] if n + 1 < len(states) else None
    return states[n] if following is None else following


def _names_road(token: Token, intersection_map: IntersectionMap | None) -> bool:
    legs = intersection_map.legs if intersection_map else ()
    words = {part for leg in legs for part in (leg.road or "").casefold().split()}
    return token.has("road") or (token.text in words and not token.has("side", "bound"))


def _build_entry(text: str, turn: int, tokens: Sequence[Token], found: _Judged) -> AccountEntry:
    """The entry of tokens that stand side by side and share a state."""
    start, end = tokens[0].start, tokens[-1].end
    mended = f" (read as '{tokens[0].mended}')" if tokens[0].mended else ""
    return AccountEntry(
        turn=turn,
        start=start,
        end=end,
        words=text[start:end],
        state=found.state,
        claim=found.claim,
        evidence=found.evidence + mended,
        agents=found.agents,
    )
