"""The account: a state for every content word of the texts, and the verdict of the whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from scenewright.scene.account import AccountEntry, WordState
from scenewright.scene.events import Finding, Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord
from scenewright.tools.account.binding import bind_mentions
from scenewright.tools.account.claims import Binding, Claim, ClaimReader, Result
from scenewright.tools.account.facts import SceneFacts
from scenewright.tools.account.mentions import Mention, find_mentions
from scenewright.tools.account.vocabulary import Token, load_vocabulary, read_tokens
from scenewright.tools.relation_checker import check

_STANDS = ("place", "crosswalk", "adverb", "stands", "request", "unit", "change")
_TURNS_MEANING = ("negation", "sequence", "order")
"""Senses of function words that turn a meaning, which are content (SEMANTICS 9)."""
_Judged = tuple[WordState, str | None, str, tuple[int, ...]]
"""State, claim, evidence and agents of a word."""
_SERVED = {
    "constraint": ("order",),
    "behavior": ("stop", "brake", "times"),
    "impact_point": ("point", "place"),
}
"""Senses of words for which what a later stage served them as is believed."""
_STRICT = ("event", "side", "heading", "movement", "tie")
_WEAK = ("phrase", "moves", "crosswalk", "crossing", "light")
"""Types that hold of nearly every scene: they do not outweigh a claim of the others that fails."""
_DENIABLE = ("normal", "stop", "brake", "red", "reaction", "beyond", "background", "noun", "avoid", "manner",
             "crosswalk", "jaywalking", "turn", "order", "light", "sight")  # fmt: skip
_NOT_SHOWN = "no claim covers it"
_BEYOND = {
    "animal": "animals are not shown", "rail": "trams and trains are not shown",
    "vehicle": "road users of this kind are not shown", "place": "the place is not shown",
    "object": "objects of this kind are not shown", "weather": "weather is not shown",
    "sound": "sounds are not shown", "gesture": "gestures are not shown",
    "harm": "nothing tests it on tracks",
}  # fmt: skip


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
    """The proof with a state for each content word of the scene's texts.

    A contradicted word, or an event that was made though no word asks for it, is a finding.
    """
    if scene.meta.rules is None or scene.meta.driven_by is not None:
        return proof
    texts = scene.meta.texts
    facts = SceneFacts(scene, proof, intersection_map)
    entries = _drop_replaced(
        [each for turn, text in enumerate(texts) for each in _account_text(text, turn, facts)],
        texts,
    )
    false = tuple(_report(each) for each in entries if each.state == "contradicted")
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
    kept: list[AccountEntry] = []
    for entry in entries:
        kind = (entry.claim or "").partition(" ")[0]
        later = [e for e in entries if e.turn > entry.turn]
        changed = {(e.claim or "").partition(" ")[0] for e in later if e.state == "seen"}
        removed = any(_removes(text) for text in texts[entry.turn + 1 :])
        false = entry.state in ("contradicted", "not_shown") and entry.claim is not None
        if false and entry.turn < len(texts) - 1 and (kind in changed or removed):
            continue
        relative = kind in _RELATIVE or entry.claim is None
        if entry.state in ("contradicted", "not_shown") and relative and entry.turn:
            if {each.text for each in read_tokens(texts[entry.turn])} & _COMPARES:
                reason = {"state": "stands_anyway", "evidence": "a change to what was there before"}
                kept.append(entry.model_copy(update=reason))
                continue
        told = any(e.words.lower() == entry.words.lower() and e.turn < entry.turn for e in entries)
        if false and told and kind in ("class", "count", "object"):
            reason = {"state": "stands_anyway", "evidence": "what was there before"}
            kept.append(entry.model_copy(update=reason))
            continue
        kept.append(entry)
    return kept


_RELATIVE = ("number", "count", "stop", "braking", "density", "background", "order")
"""Types of claims that a change may make of how it was before: "half a metre earlier"."""
_COMPARES = frozenset(
    "earlier later faster slower add remove more less fewer closer nearer further farther longer"
    " shorter half double twice another sooner harder softer quicker increase reduce".split()
)


def _removes(text: str) -> bool:
    return any(each.text in _REMOVES for each in read_tokens(text))


_REMOVES = frozenset(
    [
        "remove",
        "delete",
        "drop",
        "rid",
        "without",
        "no",
        "swap",
        "replace",
        "reverse",
        "instead",
        "nobody",
    ]
)


def _report(entry: AccountEntry) -> Finding:
    return Finding(
        rule="word_contradicted",
        agents=entry.agents,
        detail=f"'{entry.words}' says {entry.claim}; the scene shows {entry.evidence}",
    )


def list_unknown_words(
    text: str, intersection_map: IntersectionMap | None
) -> tuple[AccountEntry, ...]:
    """The words of a text that no scene at a place can show, whatever is planned."""
    tokens = read_tokens(text)
    return tuple(
        _build_entry(text, 0, n, n + 1, tokens, "not_shown", None, reason, ())
        for n, token in enumerate(tokens)
        if (reason := _find_unknown(tokens, n)) is not None
        and not _is_function(token) and not _names_road(token, intersection_map)
    )  # fmt: skip


def _find_unknown(tokens: Sequence[Token], n: int) -> str | None:
    """Why nothing can show a word; None where something may."""
    token = tokens[n]
    if token.kind != "word" or token.text.endswith("ly"):
        return None
    families = {sense.partition(".")[0] for sense in token.senses}
    if families == {"beyond"} and not token.phrase and not _is_denied(tokens, n):
        return _BEYOND[token.list_values("beyond")[0]]
    return None if families or token.phrase else _NOT_SHOWN


def _is_denied(tokens: Sequence[Token], n: int) -> bool:
    for each in reversed(tokens[max(0, n - 4) : n]):
        if each.kind in ("end", "comma") or each.text in ("a", "an", "the", "and", "but"):
            return False
        if each.negates:
            return True
    return False


def _is_function(token: Token) -> bool:
    if token.kind in ("end", "comma", "arrow"):
        return True
    return (
        token.text in load_vocabulary().function or token.text.partition("'")[0] in load_vocabulary().function
    ) and not (token.has(*_TURNS_MEANING) and len(token.text) > 2)  # fmt: skip


def _account_text(text: str, turn: int, facts: SceneFacts) -> Iterator[AccountEntry]:
    tokens = read_tokens(text)
    mentions = find_mentions(tokens)
    claims = ClaimReader(tokens, mentions).read()
    binding, results = bind_mentions(mentions, claims, facts)
    by_token: dict[int, list[tuple[Claim, Result]]] = {}
    for claim, result in zip(claims, results, strict=True):
        for n in claim.tokens:
            by_token.setdefault(n, []).append((claim, result))
    for index in _find_repeated(mentions, binding, facts):
        claim = Claim("class", "a road user of its own", mentions[index].nouns, (), _fail)
        for n in claim.tokens:
            by_token[n] = [(claim, Result(False, "one agent in place of two"))]
    states = [_judge(n, tokens, by_token.get(n, []), facts, text) for n in range(len(tokens))]
    for n in reversed(range(len(tokens))):
        if (tokens[n].negates or tokens[n].has("almost")) and not (states[n] or ("",))[0] == "seen":
            states[n] = _copy_near(states, tokens, n)
    start = 0
    for n, found in enumerate(states):
        if found is None or _is_silent(tokens[n], found):
            continue
        start = n if found != (states[n - 1] if n else None) or start > n else start
        after = states[n + 1] if n + 1 < len(states) else None
        if after != found or _is_silent(tokens[n + 1], found):
            yield _build_entry(text, turn, start, n + 1, tokens, *found)
            start = n + 2


def _fail(_facts: SceneFacts, _binding: Binding) -> Result:
    return Result(False)


def _find_repeated(
    mentions: Sequence[Mention], binding: Binding, facts: SceneFacts
) -> Iterator[int]:
    """Mentions without an article for an agent told of before, while another is not told of."""
    asked = {n for r in facts.scene.relations for n in (r.from_, r.to) if n in facts.foreground}
    told = set().union(*binding.values()) if binding else set()
    known: set[int | str] = set()
    for index, mention in enumerate(mentions):
        if mention.pronoun or mention.definite or mention.label:
            continue
        bound = binding.get(index, frozenset())
        if len(bound) == 1 and bound <= known and asked - told:
            yield index
        known |= bound


def _is_silent(token: Token, found: _Judged) -> bool:
    """Whether a function word needs no state of its own."""
    return _is_function(token) and found[0] != "seen" and not (token.negates or token.has("sequence"))


def _judge(
    n: int, tokens: Sequence[Token], found: list[tuple[Claim, Result]], facts: SceneFacts, text: str
) -> _Judged | None:
    token = tokens[n]
    if token.kind in ("end", "comma", "arrow"):
        return None
    held = [(c, r) for c, r in found if r.holds]
    false = [(c, r) for c, r in found if r.holds is False and c.type in _STRICT]
    if any(c.type == "phrase" for c, _ in held):  # the whole phrase says it, not a word of it
        false = [(c, r) for c, r in false if c.type != "event"]
    if held and not (false and all(c.type in _WEAK for c, _ in held)):
        claim, result = min(held, key=lambda each: each[0].type in _WEAK)
        return "seen", f"{claim.type} {claim.value}", result.evidence, result.agents
    if _is_function(token):
        return None
    if hint := _find_hint(token, found, facts):
        return "seen", hint[0], hint[1], ()
    if _names_road(token, facts.intersection_map):
        return "seen", "road", "a street of this place", ()
    families = {sense.partition(".")[0] for sense in token.senses}
    if "beyond" in families and not (families & {"manner"}):
        if _is_denied(tokens, n):
            return "stands_anyway", None, "no scene made here has it", ()
        if families == {"beyond"}:
            return "not_shown", None, _BEYOND[token.list_values("beyond")[0]], ()
    if "stands" in families and (reason := _contradict_place(token, facts)):
        return "contradicted", token.text, reason, ()
    false = false or [(c, r) for c, r in found if r.holds is False and c.type == "crosswalk"]
    limit = token.unit is not None and not found
    if (families & set(_STANDS) or limit) and not false:
        return "stands_anyway", None, "true of every scene made here", ()
    if "manner" in families or (token.text.endswith("ly") and not families):
        return "manner", None, "tracks cannot speak of it", ()
    false = false or [(c, r) for c, r in found if r.holds is False]
    if false:
        claim, result = false[0]
        return (
            "contradicted",
            f"{claim.type} {claim.value}",
            result.evidence,
            (),
        )
    if token.text in ("let", "have") and not found:
        return "stands_anyway", None, "true of every scene made here", ()
    if token.has("sequence") and not any(r.holds is False for _, r in found):
        return None  # it joins no two events
    if families == {"order"} and token.text in ("first", "last", "second"):
        return None
    return "not_shown", None, _NOT_SHOWN, ()


def _copy_near(states: Sequence[_Judged | None], tokens: Sequence[Token], n: int) -> _Judged | None:
    """The state of the words that a negation or "almost" belongs to, mostly those after it."""
    after = range(n + 1, min(len(tokens), n + 7))
    for m in (*after, *range(n - 1, max(-1, n - 5), -1)):
        each = states[m]
        if tokens[m].kind == "end" or each is None:
            continue
        if not (each[1] or "").startswith("moves") and tokens[m].has("event", *_DENIABLE):
            return each
    following = states[n + 1] if n + 1 < len(states) else None
    return following or states[n]


def _find_hint(
    token: Token, found: Sequence[tuple[Claim, Result]], facts: SceneFacts
) -> tuple[str, str] | None:
    """What a later stage served a word as, where the checker found it on the tracks.

    Believed for what no claim of a text can say by itself, such as clauses and standstills, and
    only of words of that kind.
    """
    if any(r.holds is False and c.type not in ("stop", "braking") for c, r in found):
        return None
    for entry in facts.proof.said:
        senses = _SERVED.get(entry.became, ())
        covers = entry.start <= token.start and token.end <= entry.end
        if covers and token.has(*senses) and entry.status == "realised" and entry.evidence:
            return f"{entry.became} {entry.value or ''}".strip(), entry.evidence
    return None


def _names_road(token: Token, intersection_map: IntersectionMap | None) -> bool:
    legs = intersection_map.legs if intersection_map else ()
    words = {part for leg in legs for part in (leg.road or "").casefold().split()}
    return token.text in words and not token.has("side", "bound")


def _contradict_place(token: Token, facts: SceneFacts) -> str | None:
    """Why what is said of every scene is false of this one."""
    if token.text in ("signalised", "signalized", "signalled") and not facts.scene.signals:
        return "a place without lights"
    if token.text in ("daylight", "daytime", "sunny") and not 300 <= facts.get_minutes() <= 1290:
        return f"a scene at {facts.scene.meta.time_of_day}"
    return None


def _build_entry(
    text: str, turn: int, start: int, stop: int, tokens: Sequence[Token],
    state: WordState, claim: str | None, evidence: str, agents: tuple[int, ...],
) -> AccountEntry:  # fmt: skip
    first, last = tokens[start], tokens[stop - 1]
    mended = f" (read as '{first.mended}')" if first.mended else ""
    return AccountEntry(
        turn=turn, start=first.start, end=last.end, words=text[first.start : last.end],
        state=state, claim=claim, evidence=evidence + mended, agents=agents,
    )  # fmt: skip
