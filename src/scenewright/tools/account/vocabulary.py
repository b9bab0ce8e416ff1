"""The words that the account knows, and texts cut into tokens with their senses."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from importlib.resources import files
from itertools import chain

from rapidfuzz import process
from rapidfuzz.distance import OSA

from scenewright.scene.english import load_english_words
from scenewright.scene.kinds import list_kinds
from scenewright.scene.relations import load_patterns

_TOKEN = re.compile(
    r"(?P<clock>[0-2]\d[0-5]\d(?=\s?(?:h|hrs|hours)\b)|\d{1,2}[:.h]\d{2}\s*(?:[ap]\.?\s?m\b\.?)?|\d{1,2}\s*[ap]\.?\s?m\b\.?)"
    r"|(?P<figure>\d+(?:[.,]\d+)?)\s*(?P<unit>km\s?/?\s?h|kph|kmph|kms?|mph|m\s?/\s?s(?:2|²|\^2)?|"
    r"mps|meters?\s?per\s?second|metres?\s?per\s?second|meters?|metres?|min(?:utes?)?|seconds?|secs?|"
    r"ms|feet|foot|ft|cm|centimet(?:er|re)s?|percent|%|g|m|s)?(?![a-z0-9])"
    r"|(?P<ordinal>\d+(?:st|nd|rd|th))"
    r"|(?P<named>(?:veh(?:icle)?|ped(?:estrian)?|car|van|truck|bus|bike|cyclist|unit)(?=\d))"
    r"|(?P<word>[^\W\d_]+(?:['’](?:t|s|re|ve|ll|d|m|clock)\b)?\d*)"
    r"|(?P<end>[.;!?\n])|(?P<comma>[,:()—–])|(?P<arrow>->|=>|→|>)",
    re.IGNORECASE,
)
WORDS = tomllib.loads(files(__package__).joinpath("words.toml").read_text("utf-8"))
_IRREGULAR = {form: word for word, forms in WORDS["irregular"].items() for form in forms}
_KEEP = frozenset({"red", "bus", "crossing", "is", "was", "as", "this", "us", "its", "his", "less"})
_SPELT: dict[str, float] = WORDS["spelt"]


@dataclass(frozen=True)
class Token:
    """A word, figure or stop of a text.

    Attributes:
        start, end: characters of the text, end exclusive.
        text: the characters, lower case; stem: the word without its ending.
        number, unit: of a figure, or of a number that is spelt out.
        senses: what the word may claim; nouns have `noun.CLASS`.
        sentence: number of its sentence; kind: word, figure, clock, end, comma or arrow.
        mended: the known word that a misspelt one was taken for; capital: it begins with one.
        phrase: type of the event, and tokens, of a phrase of a relation file that it belongs to.
    """

    start: int
    end: int
    text: str
    stem: str
    kind: str
    sentence: int
    number: float | None = None
    unit: str | None = None
    senses: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    mended: str | None = None
    phrase: tuple[str, int, int] | None = None
    capital: bool = False

    def has(self, *senses: str) -> bool:
        """Whether it has any of the senses, or one of a family such as `density`."""
        return any(s in self.senses or any(k.startswith(s + ".") for k in self.senses)
                   for s in senses)  # fmt: skip

    @property
    def negates(self) -> bool:
        """Whether it turns the meaning of words near it, also within a phrase."""
        return self.has("negation") or self.is_in("negations")

    def list_values(self, family: str) -> tuple[str, ...]:
        """The values of a family of senses, such as `north` of `side`."""
        return tuple(k.partition(".")[2] for k in self.senses if k.startswith(family + "."))

    def list_families(self) -> frozenset[str]:
        """The families of its senses."""
        return frozenset(sense.partition(".")[0] for sense in self.senses)

    def is_in(self, *lists: str) -> bool:
        """Whether its text is on any of the lists of words.toml."""
        return any(self.text in load_vocabulary().lists[name] for name in lists)


@dataclass(frozen=True)
class Vocabulary:
    """Senses of words and phrases.

    Attributes:
        exact, stems: (words...) -> senses, as they stand and by their stems.
        function: words without content; contracted: those that deny without an apostrophe, "cant";
            longest: words of the longest phrase.
        singles: words and stems of any phrase; joined: phrases of two words written as one,
            "redlight", with where the second begins; spelling: words that a misspelt one may be.
        lists: words that the code asks for by the name of their list.
    """

    exact: Mapping[tuple[str, ...], frozenset[str]]
    stems: Mapping[tuple[str, ...], frozenset[str]]
    function: frozenset[str]
    contracted: frozenset[str]
    longest: int
    singles: frozenset[str]
    joined: Mapping[str, int]
    spelling: frozenset[str]
    lists: Mapping[str, frozenset[str]]


def reduce_word(word: str) -> str:
    """The word without the ending of its inflection.

    >>> [reduce_word(w) for w in ("hits", "hitting", "crosses", "yielded", "cycling", "gave")]
    ['hit', 'hit', 'cros', 'yield', 'cycl', 'giv']
    """
    word = _IRREGULAR.get(word, word)
    if len(word) <= 3 or word in _KEEP:
        return word
    for ending in ("ings", "ing", "ers", "ied", "ies", "edly", "ed", "es", "s"):
        if word.endswith(ending) and len(word) - len(ending) >= 2 and word[-3:] != "eed":
            root = word[: -len(ending)]
            if ending in ("ied", "ies"):
                return root + "y"
            if ending == "s" and root.endswith("s"):
                break
            word = root + ("er" if ending == "ers" else "")
            break
    if len(word) > 3 and word[-1] == word[-2]:
        word = word[:-1]
    return word[:-1] if word.endswith("e") and len(word) > 2 else word


def load_vocabulary() -> Vocabulary:
    """The vocabulary of words.toml, and the words of kinds of motion."""
    return _load_vocabulary(os.environ.get("SCENEWRIGHT_RELATIONS"))


@cache
def _load_vocabulary(_own: str | None) -> Vocabulary:
    exact: dict[tuple[str, ...], set[str]] = {}
    stems: dict[tuple[str, ...], set[str]] = {}
    nouns = {f"noun.{name}": phrases for name, phrases in WORDS["nouns"].items()}
    own = ((f"motion.{kind.id}", kind.words) for kind in list_kinds("motion"))
    for sense, phrases in chain(
        nouns.items(), WORDS["senses"].items(), WORDS["loose"].items(), own
    ):
        for phrase in phrases:
            words = tuple(phrase.lstrip("=").split())
            table = exact if phrase.startswith("=") else stems
            key = words if phrase.startswith("=") else tuple(map(reduce_word, words))
            table.setdefault(key, set()).add(sense)
    function = frozenset(WORDS["function"]["words"])
    spelling = function | {w for key in exact for w in key} | {
        w.lstrip("=") for group in (*nouns.values(), *WORDS["senses"].values())
        for phrase in group for w in phrase.split()
    }  # fmt: skip
    singles = frozenset(w for key in (*exact, *stems) for w in key)
    return Vocabulary(
        exact={k: frozenset(v) for k, v in exact.items()},
        stems={k: frozenset(v) for k, v in stems.items()},
        function=function,
        contracted=frozenset(w for w in function if w.endswith("nt")),
        longest=max(map(len, (*exact, *stems))),
        singles=singles,
        joined={
            "".join(pair): len(pair[0])
            for phrases in (*WORDS["nouns"].values(), *WORDS["senses"].values())
            for pair in (phrase.lstrip("=").split() for phrase in phrases)
            if len(pair) == 2 and singles.isdisjoint(("".join(pair), reduce_word("".join(pair))))
        },
        spelling=frozenset(w for w in spelling if len(w) > 2),
        lists={name: frozenset(words) for name, words in WORDS["lists"].items()},
    )


def read_tokens(text: str) -> tuple[Token, ...]:
    """The text cut into tokens, each with the senses of the longest phrase that holds it."""
    return _read_tokens(text, os.environ.get("SCENEWRIGHT_RELATIONS"))


@lru_cache(maxsize=64)
def _read_tokens(text: str, own: str | None) -> tuple[Token, ...]:
    phrases, stems = _list_phrases(own)
    plain = [each if each.stem in stems else _mend_spelling(each) for each in _cut(text)]
    senses_by_token: list[dict[str, tuple[int, int]]] = [{} for _ in plain]
    lengths = [0] * len(plain)
    for start, stop, senses in _match_phrases(plain):
        for n in range(start, stop):
            # a phrase is more than its words: shorter ones inside it say nothing of their own
            if stop - start < lengths[n]:
                continue
            if stop - start > lengths[n]:
                lengths[n] = stop - start
                senses_by_token[n] = {}
            senses_by_token[n] |= dict.fromkeys(sorted(senses), (start, stop))
    phrases_by_token = _find_relation_phrases(plain, phrases)
    return tuple(
        replace(token, senses=senses, phrase=phrases_by_token.get(n))
        for n, (token, senses) in enumerate(zip(plain, senses_by_token, strict=True))
    )


def is_label(tokens: Sequence[Token], n: int) -> bool:
    """Whether a number says nothing of the scene: an item's ("1) ..."), a document's ("Item 4(a)",
    "type 5"), an age."""
    if tokens[n].number is None or tokens[n].unit:
        return False
    follow = tokens[n + 1] if n + 1 < len(tokens) else None
    if (follow is not None and follow.stem == "year") or (n and tokens[n - 1].text == "aged"):
        return True
    around = "".join(token.text for token in (*tokens[n - 1 : n], *tokens[n + 1 : n + 2]))
    if n > 1 and around in (",,", "()") and (tokens[n - 2].has("noun") or tokens[n - 2].capital):
        return True  # "a teacher, 71, ..."
    if n and tokens[n].start - tokens[n - 1].end == 1 and is_label(tokens, n - 1):
        return True  # "claim 77-20941"
    several = follow is not None and follow.has("noun") and follow.text.endswith("s")
    if n and tokens[n - 1].is_in("numbered") and not (several and follow and follow.text != "bus"):
        return True  # "question 7", "the number 14 bus"
    if n > 1 and tokens[n - 1].is_in("be") and tokens[n - 2].is_in("pronouns"):
        return follow is None or follow.kind in ("end", "comma")  # "he is ninety"
    if follow is None or follow.start > tokens[n].end + 1:
        return False
    begins = n == 0 or tokens[n - 1].kind in ("end", "comma")
    return follow.text == ")" or (begins and follow.text in (".", ":"))


@cache
def _list_phrases(
    _own: str | None,
) -> tuple[tuple[tuple[str, tuple[str, ...]], ...], frozenset[str]]:
    """The event and the phrases of each relation, and the stems of all their words."""
    phrases = tuple((pattern.proof.event, pattern.phrases) for pattern in load_patterns())
    words = (word for _, said in phrases for each in said for word in each.lower().split())
    return phrases, frozenset(map(reduce_word, words))


def _find_relation_phrases(
    tokens: list[Token], phrases: tuple[tuple[str, tuple[str, ...]], ...]
) -> dict[int, tuple[str, int, int]]:
    """Tokens that belong to a phrase of a relation file, the shipped ones and the user's."""
    relation_phrases: dict[int, tuple[str, int, int]] = {}
    stems = [token.stem for token in tokens]
    for event, words in _list_relation_phrases(phrases):
        for n in range(len(stems) - len(words) + 1):
            if stems[n : n + len(words)] == words:
                stop = n + len(words)
                relation_phrases |= dict.fromkeys(range(n, stop), (event, n, stop))
    return relation_phrases


@cache
def _list_relation_phrases(
    patterns: tuple[tuple[str, tuple[str, ...]], ...],
) -> list[tuple[str, list[str]]]:
    """Event and stems of what stands between the roles of each phrase."""
    parts = (
        (event, [reduce_word(w) for w in re.findall(r"[^\W\d_]+", part.lower())])
        for event, phrases in patterns
        for phrase in phrases
        for part in re.split(r"\{(?:from|to)\}", phrase)
    )
    return [(event, words) for event, words in parts if len(words) > 1 or len("".join(words)) > 3]


def _cut(text: str) -> Iterator[Token]:
    sentence = 0
    for match in _TOKEN.finditer(text):
        kind = match.lastgroup or "word"
        kind = {"unit": "figure", "named": "word"}.get(
            kind, kind
        )  # "veh2" is a noun and its number
        if kind == "end":
            sentence += 1
        low = match[0].lower().strip().replace("’", "'")
        stem = reduce_word(low if low.endswith("n't") else low.partition("'")[0])
        figure = match["figure"]
        number = float(figure.replace(",", ".")) if figure else _SPELT.get(low)
        number = float(low[1:]) if kind == "word" and re.fullmatch(r"x\d", low) else number
        token = Token(
            match.start(), match.start() + len(match[0].rstrip()), low, stem, kind,
            sentence, number, (match["unit"] or "").lower().replace(" ", "") or None,
            capital=match[0][:1].isupper(),
        )  # fmt: skip
        cut = load_vocabulary().joined.get(low)
        if cut is None or low in load_english_words():
            yield token
            continue
        for start, end in ((0, cut), (cut, len(low))):
            part, at = low[start:end], token.start
            yield replace(
                token, text=part, stem=reduce_word(part), start=at + start, end=at + end,
                number=_SPELT.get(part),
            )  # fmt: skip


def _match_phrases(tokens: list[Token]) -> Iterator[tuple[int, int, frozenset[str]]]:
    words = load_vocabulary()
    for start, first in enumerate(tokens):
        if first.text.endswith("n't") or first.text in words.contracted:
            yield start, start + 1, frozenset({"negation"})
        for stop in range(min(len(tokens), start + words.longest), start, -1):
            part = tokens[start:stop]
            if any(each.kind == "end" for each in part) or _is_duration(tokens, stop):
                continue
            exact = words.exact.get(tuple(each.text for each in part), frozenset())
            stems = words.stems.get(tuple(each.stem for each in part), frozenset())
            if exact | stems:
                yield start, stop, exact | stems
        apart = tokens[start : start + 3]
        if (
            len(apart) == 3
            and apart[1].is_in("pronouns", "first_person")
            and apart[2].is_in("particles")
        ):
            senses = words.stems.get((first.stem, apart[2].stem))
            if senses:  # else its words keep their own
                yield start, start + 3, senses


def _is_duration(tokens: list[Token], n: int) -> bool:
    """Whether "for" before a token says how long: "stop for five seconds", but not "for a bus"."""
    return tokens[n - 1].text == "for" and any(
        token.stem == "second" or (token.kind == "figure" and token.text[-1] == "s")
        for token in tokens[n : n + 2]
    )


def _mend_spelling(token: Token) -> Token:
    """A misspelt word with the stem of the one that it is taken for."""
    words = load_vocabulary()
    known = token.text in words.function or not words.singles.isdisjoint((token.text, token.stem))
    doubled = token.text[-1:] == token.text[-2:-1] and token.text[:-1] in words.spelling
    if doubled and token.text not in words.spelling:
        once = token.text[:-1]  # "hitt"
        return replace(token, text=once, stem=reduce_word(once), mended=once)
    if token.kind != "word" or len(token.text) < 2 or known or token.text in load_english_words():
        return token
    alike = {w for part in _drop_letters(token.text) for w in _index_spelling().get(part, ())}
    near = [w for w in alike if _is_one_slip(token.text, w)] or _find_alike(token.text)
    if token.capital:
        near = [w for w in near if w not in _SPELT]  # "Sven" is no "seven"
    if not near:
        return token
    best = min(near, key=lambda w: (w[0] != token.text[0], abs(len(w) - len(token.text)), w))
    return replace(token, text=best, stem=reduce_word(best), mended=best)


def _is_one_slip(word: str, known: str) -> bool:
    """Whether two letters are swapped, one is lost or put in; in long words, another one.

    >>> [_is_one_slip(*pair) for pair in (("yeilds", "yields"), ("bicicle", "bicycle"))]
    [True, True]
    >>> _is_one_slip("cat", "car")
    False
    """
    n = next((k for k, (a, b) in enumerate(zip(word, known, strict=False)) if a != b), None)
    if n is None:
        return abs(len(word) - len(known)) == 1 and len(known) > 3
    if word[n + 1 :] == known[n:] or word[n:] == known[n + 1 :]:
        return len(known) > 3 or known in load_vocabulary().function
    if word[n : n + 2] == known[n : n + 2][::-1] and word[n + 2 :] == known[n + 2 :]:
        return True
    return len(known) > 5 and word[n + 1 :] == known[n + 1 :]


@lru_cache(maxsize=1024)
def _find_alike(word: str) -> list[str]:
    """Known words of the same letters in another order, and long ones two slips away: "vehical"."""
    known = [w for w in load_vocabulary().spelling if w[0] == word[0] and len(word) > 4]
    alike = [w for w in known if sorted(w) == sorted(word)]
    long = [w for w in known if len(word) > 6 and w[:4] == word[:4]]
    return alike or [
        w for w, *_ in process.extract(word, long, scorer=OSA.distance, score_cutoff=2)
    ]


def _drop_letters(word: str) -> set[str]:
    """The word, and the word without any one of its letters."""
    return {word} | {word[:n] + word[n + 1 :] for n in range(len(word))}


@cache
def _index_spelling() -> dict[str, list[str]]:
    """Known words by what any one slip leaves of them: words one slip apart share an entry."""
    index: dict[str, list[str]] = {}
    for word in sorted(load_vocabulary().spelling):
        for part in _drop_letters(word):
            index.setdefault(part, []).append(word)
    return index
