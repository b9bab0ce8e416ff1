"""The form of words and what they are likely to want, weighed against one another.

Rules read the form; the model of turns ranks intents. Where both agree, that is it. Where they
differ the surer one counts, and where neither is sure a question is put instead of a change.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from scenewright.authoring.intent_edits import (
    LIKELY,
    MAKES,
    STEPS,
    SURE,
    decline,
    find_new_kind,
    guess_intent,
    is_consistent,
    relates_known,
    spell_out,
)
from scenewright.authoring.read_turn import offer_sentences
from scenewright.authoring.talk import Talk, simplify
from scenewright.authoring.turn_kind import Kind, TurnKind, classify_turn, read_name
from scenewright.backends.offline import (
    CLASSES,
    WORDS,
    Patterns,
    find_named,
    rank_intents,
)
from scenewright.scene.edits import (
    ChangeAgent,
    Clarification,
    DeclinedTurn,
    Edit,
    Edits,
    NewScene,
    Reading,
    Relate,
)
from scenewright.scene.route_table import WAY_FIELDS

_PATTERNS = Patterns("second_opinion")

Read = Callable[[str], Reading]
_NUMBERS: dict[str, int] = WORDS["turn_kind"]["numbers"]
_SENTENCES: dict[str, str] = WORDS["second_opinion"]["sentences"]
_MOST_OFFERED, _LEAST_OFFERED = 3, 0.08
_HARDLY = 0.12
"""Probability below which words hardly ask for a change."""


def weigh_kind(words: str, *, scene: bool) -> TurnKind:
    """The kind of the words, by their form and by what they are likely to want.

    Args:
        scene: whether there is one that they can be about.
    """
    turn = classify_turn(words)
    if turn.kind not in ("words", "question"):
        return turn
    guess = guess_intent(words)
    if not scene and guess.intent == "new_scene" and guess.chance >= LIKELY:
        return TurnKind(kind="words", words=words)
    if turn.kind == "question":
        if guess.is_change and guess.chance >= SURE and not words.rstrip().endswith("?"):
            return TurnKind(kind="words", words=words)
        if guess.intent in _COMMANDS and guess.chance >= LIKELY - 0.05:
            return _step(STEPS[guess.intent], words)
        if guess.intent in ("why_refused", "help") and guess.chance >= SURE:
            return TurnKind(kind="help" if guess.intent == "help" else "why", words=words)
        return turn.model_copy(update={"topic": _find_topic(words)})
    clause = _find_clause(words)
    if clause is not None:
        return clause
    greets = not scene and guess.intent in ("help", "talk")
    asks = guess.is_question and guess.intent != "q_story"  # an order, as changes are
    if guess.chance < (LIKELY if greets or asks else SURE - 0.1):
        return turn
    if guess.is_question and (scene or guess.chance >= SURE):
        return TurnKind(kind="question", words=words, topic=guess.intent)
    steps = ("version", "undo", "redo")
    if scene and (
        guess.intent == "version" or (guess.intent in steps and _PATTERNS.newest.search(words))
    ):
        found = _PATTERNS.version.search(words.lower())
        said = None if found is None else found[1] or found[2]
        number = None if said is None else _NUMBERS.get(said) or int(said)
        return TurnKind(kind="version", words=words, number=number)
    if guess.intent in STEPS and not _is_change(words):
        return _step(STEPS[guess.intent], words)
    return turn


def _step(name: str, words: str) -> TurnKind:
    """A turn about the conversation: how many steps back or forth, under which name to save."""
    kind: Kind = name  # type: ignore[assignment]
    if kind not in ("undo", "redo"):
        return TurnKind(kind=kind, words=words, name=read_name(words) if kind == "save" else None)
    count = _read_number(words) or len(re.findall(r"\b(?:undo|redo)\b", words.lower()))
    return TurnKind(kind=kind, words=words, count=max(count, 1))


def _find_topic(words: str) -> str | None:
    """The topic of a question, as far as the model of turns knows it."""
    asked = [each for each in rank_intents(words) if each.name.startswith("q_")]
    return asked[0].name if asked[0].chance >= LIKELY else None


def _read_number(words: str) -> int | None:
    plain = words.lower()
    if re.search(r"\b(?:first|original|very start|beginning)\b", plain):
        return 1
    found = _PATTERNS.number.search(plain)
    return None if found is None else _NUMBERS.get(found[1]) or int(found[1])


def _is_change(words: str) -> bool:
    """Whether a clause of several asks for a change: thanks may stand beside it."""
    clauses = [each for each in _PATTERNS.clauses.split(words) if each.strip()]
    if len(clauses) < 2:
        return False
    guesses = [guess_intent(clause) for clause in clauses]
    return any(guess.is_change and guess.chance >= LIKELY for guess in guesses)


def correct(words: str, before: str) -> tuple[str, bool]:
    """ "sorry, 12" after "make the gap 8 m": the words before with what is said instead.

    Words that are no such correction stay as they are. Also returns whether another agent is meant,
    so that what was done to the first is to be taken back.
    """
    plain = " ".join(words.lower().strip(" .!").split())
    bare = _PATTERNS.that_is.sub("", _PATTERNS.rather.sub("", plain))
    if re.fullmatch(r"\d+(?:[.,]\d+)?(?: ?[a-z/]+)?", plain) and _PATTERNS.figure.search(before):
        return _PATTERNS.figure.sub(_PATTERNS.figure.search(plain)[0], before, count=1), False  # type: ignore[index]
    if bare == plain or not before or len(bare.split()) > 4:
        return words, False
    for pattern, whole in (
        (_PATTERNS.clock, r"[\d:]+(?: ?[ap]m)?"),
        (_PATTERNS.figure, r"\d+(?:[.,]\d+)?(?: ?[a-z/²]+){0,2}"),
        (_PATTERNS.side, r"(?:from |to |on |in )?(?:the )?(?:north|south|east|west)(?: side)?"),
        (_PATTERNS.agent, r"the (?:other )?[a-z-]+"),
    ):
        new, old = pattern.search(bare), pattern.search(before.lower())
        if new is not None and old is not None and re.fullmatch(whole, bare):
            return (
                f"{before[: old.start()]}{new[0]}{before[old.end() :]}",
                pattern is _PATTERNS.agent,
            )
    return words, False


def correct_within(words: str) -> str:
    """ "make the car slower, sorry, the truck": the first part with what is said instead."""
    first, *rest = _PATTERNS.turns_back.split(words, maxsplit=1)
    fixed = correct(rest[0], first)[0] if rest else words
    return fixed if rest and fixed != rest[0] else words


_LONGEST_FIRST = 30


def check_first_words(words: str) -> DeclinedTurn | Clarification | None:
    """What to say to words with which no scene can begin; None for all others.

    An event without agents is asked back; a change of a scene where there is none yet is refused.
    """
    guess, plain = guess_intent(words), words.lower()
    verb = next(
        (verb for verb, pattern in WORDS["second_opinion"]["events"] if re.search(pattern, plain)),
        None,
    )
    if verb is not None and not find_named(plain) and len(plain.split()) <= _LONGEST_FIRST:
        sentences = [f"{one} {verb} {other}" for one, other in WORDS["second_opinion"]["parties"]]
        return offer_sentences("Who takes part?", sentences)
    events = ("collide", "near_miss", "yields", "follow", "add_agent", "nothing_happens", "jaywalk")
    if not guess.is_change or guess.chance < SURE or guess.intent in events:
        return None
    if len(_PATTERNS.new_one.findall(words.lower())) >= 1:
        return None
    reason = WORDS["second_opinion"]["no_scene"]
    return DeclinedTurn(code="no_change", reason=reason)


def _find_clause(words: str) -> TurnKind | None:
    """ "wow, that was close, how fast was it?": the clause that counts, if the others say nothing.

    That is the last one, or one that is surely about the conversation, such as "please keep it".
    """
    clauses = [each for each in _PATTERNS.clauses.split(words) if each.strip()]
    if len(clauses) < 2 or _is_change(" , ".join(clauses[:-1]) + ","):
        return None
    turn, guess = classify_turn(clauses[-1]), guess_intent(clauses[-1])
    if turn.kind == "question" and not guess.is_change:
        return turn.model_copy(update={"topic": guess.intent if guess.is_question else None})
    if guess.is_change and guess.chance >= LIKELY:
        return None
    for clause in reversed(clauses):
        guess = guess_intent(clause)
        if _PATTERNS.keeps.match(clause.lower().strip()):
            return _step("save", words)
        if guess.intent in STEPS and guess.chance >= SURE and guess.intent not in _POLITE:
            return _step(STEPS[guess.intent], words)
    return turn if turn.kind in ("undo", "redo", "version", "restart") else None


_COMMANDS = ("save", "gif", "mp4", "html", "undo")
_POLITE = ("talk", "quit", "show", "play", "help")


def choose_reading(words: str, by_planner: Reading, talk: Talk, read: Read) -> Reading:
    """What the words change: as the planner read them, as is likely to be wanted, or a question.

    Args:
        read: reads a plain sentence as the planner does.
    """
    found, plain = _choose_reading(words, by_planner, talk, read), words.lower()
    if not isinstance(found, Edits):
        return found
    chances = dict(rank_intents(words))
    asked = sum(chances[name] for name in WORDS["second_opinion"]["removing"]) >= _HARDLY
    removes = any(edit.edit == "remove_agent" for edit in found.edits)
    if removes and (_PATTERNS.keeps_out.search(plain) or not asked):
        return _ask(words, talk, read) or _decline_change()
    hits = any(isinstance(edit, Relate) and edit.edge.type == "collide_at" for edit in found.edits)
    if hits and _PATTERNS.no_contact.search(plain):
        return offer_sentences("I am not sure what shall be different.", ["make it a near miss"])
    return _keep_ways(found, talk)


def _keep_ways(reading: Edits, talk: Talk) -> Edits:
    """What the words leave open of an agent's way is as it was: all of it, or after a turn where
    it comes from."""
    known = {agent.id: agent for agent in talk.situation.graph.agents}

    def keep(edit: Edit) -> Edit:
        if not isinstance(edit, ChangeAgent) or edit.node.id not in known:
            return edit
        node, was, view = edit.node, known[edit.node.id], talk.view(edit.node)
        if all(getattr(node, field) == getattr(was, field) for field in WAY_FIELDS):
            return ChangeAgent(node=talk.keep_way(node))
        if view is None or node.entry is not None or node.movement in (None, view.movement):
            return edit
        return ChangeAgent(node=node.model_copy(update={"entry": view.entry}))

    return Edits(edits=tuple(map(keep, reading.edits)))


def _choose_reading(words: str, by_planner: Reading, talk: Talk, read: Read) -> Reading:
    guess = guess_intent(words)
    if (name := talk.find_unknown_name(words)) is not None:
        called = ", ".join(agent.called for agent in talk.situation.foreground)
        return decline(f"Nobody here is called {name}; there is {called or 'nobody'}.")
    if (noun := simplify(words)) in CLASSES:
        there = [f"remove {agent.id}" for agent in talk.find_agents(f"the {noun}")[:1]]
        return offer_sentences(f"What about the {noun}?", [f"add a {noun}", *there])
    if is_consistent(by_planner, guess.intent, words, talk):
        return by_planner
    # "cars 6" is not vehicle-6, and "the parked van" no agent
    other = guess.intent in ("set_count", "park", "unpark") and guess.chance >= LIKELY
    if isinstance(by_planner, DeclinedTurn) and by_planner.code == "impossible" and not other:
        return by_planner  # it was understood, and says what the map does not allow
    if isinstance(by_planner, Edits) and (
        _is_bold(by_planner, words)
        or (guess.intent == "add_agent" and relates_known(by_planner, talk))
    ):
        by_planner = _decline_change()
    if guess.chance >= (SURE - 0.1 if isinstance(by_planner, Edits) else LIKELY):
        made = _make(guess.intent, words, talk, read)
        if made is not None:
            return made
    return _keep(words, by_planner, talk, read)


def _is_bold(reading: Edits, words: str) -> bool:
    """Whether it changes what the words hardly ask for, by all intents that make such changes."""
    if find_new_kind(simplify(words)) is not None:
        return False
    kinds = {edit.edit for edit in reading.edits}
    fitting = (e.chance for e in rank_intents(words) if kinds.intersection(MAKES.get(e.name, ())))
    return sum(fitting) < _HARDLY


def _make(intent: str, words: str, talk: Talk, read: Read) -> Reading | None:
    """What does the intent; None where that is nothing, a scene of its own, or not understood."""
    spelt = spell_out(intent, words, talk)
    if not isinstance(spelt, str):
        return spelt
    made = read(spelt)
    unclear = isinstance(made, DeclinedTurn) and made.code == "out_of_scope"
    return None if unclear or isinstance(made, NewScene) else made


def _keep(words: str, by_planner: Reading, talk: Talk, read: Read) -> Reading:
    """The planner's reading, where it may stand; else a question what is meant."""
    if isinstance(by_planner, Edits | Clarification):
        return by_planner
    if isinstance(by_planner, NewScene) and (
        # The words describe a scene of their own rather than something about this one.
        dict(rank_intents(words))["new_scene"] >= LIKELY
        or len(_PATTERNS.new_one.findall(words.lower())) >= 2
    ):
        return by_planner
    declined = by_planner if isinstance(by_planner, DeclinedTurn) else None
    if declined and declined.code not in ("no_change", "out_of_scope"):
        return declined
    known = declined is not None and declined.code != "no_change"
    return _ask(words, talk, read) or (declined if known else None) or _decline_change()


def _decline_change() -> DeclinedTurn:
    return DeclinedTurn(code="no_change", reason=WORDS["second_opinion"]["unclear"])


def _ask(words: str, talk: Talk, read: Read) -> Clarification | None:
    """ "Do you mean 1: make the car slower 2: ...": the likeliest wishes that can be done."""
    offered: list[str] = []
    for name, chance in rank_intents(simplify(words) or words)[:6]:
        if chance < _LEAST_OFFERED or name not in MAKES:
            continue
        spelt = spell_out(name, words, talk)
        if isinstance(spelt, Clarification):
            return spelt
        if isinstance(spelt, str):
            said = spelt if isinstance(read(spelt), Edits) else None
        else:
            said = _SENTENCES.get(name) if isinstance(spelt, Edits) else None
        if said is not None and said not in offered:
            offered.append(said)
    question = "I am not sure what shall be different."
    return offer_sentences(question, offered[:_MOST_OFFERED]) if offered else None
