"""Instruction text -> clean lower-case tokens."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from functools import lru_cache

from scenewright.scene.stems import stem_word

_OWNED = "car|van|truck|lorry|bus|coach|taxi|cab|motorcycle|motorbike|suv|sedan|pickup|vehicle"
_REPLACEMENTS: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(pattern), new)
    for pattern, new in (
        (r"[‘’´`]", "'"),
        (r"[“”\"*_]", " "),
        (r"\s*(?:→|⇒|=>|-{1,2}>)\s*", " to "),
        (r"\b([ap])\.\s?m\b\.?", r"\1m"),
        (r"\b(vs|st|ave|approx|no|mr|mrs|dr|e\.g|i\.e)\.(?=\s)", r"\1"),
        (r"\.{2,}|…", " , "),
        (r"\n\s*(?:[-*•]|\d+[.)])?\s*(?=[a-z])", " . "),
        (r"^\s*[-*•]\s*", ""),
        (r"\s[-–—]+\s|—", " , "),
        (r"\btheres\b", "there is"),
        (r"(?<![\w.])'?em\b(?!\.)", "them"),
        (
            rf"\b[a-z]+'s (?=(?:[a-z]+ )?(?:{_OWNED})\b)",
            "",
        ),
        (r"\bw/o\b", "without"),
        (r"\bw/", "with "),
        (r"\b(ca|wo|sha)n't\b", r"can not"),
        (r"n't\b", " not"),
        (r"\b(do|does|did|is|was|has|had|would|could|should|was)nt\b", r"\1 not"),
        (r"\bcannot\b|\bcant\b", "can not"),
        (r"\bwont\b", "will not"),
        (r"'(?:s|re|ve|ll|d|m)\b", " "),
        (r"\bit'?s\b(?= a\b| the\b| \d| almost| about| [a-z]+ing\b)", "it is"),
        (
            r"\b(?:form|frm|fron|fom|rfom)"
            r"(?= (?:the )?(?:[nsew]|n?orth|south|east|west|top|bottom)\b)",
            "from",
        ),
        (r"\bfro (?:m)?(?=the\b)", "from "),
        (r"\b(?:noth|nort|norht|nroth|notrh|nrth)(?=(?:bound|ern)?\b)", "north"),
        (r"\b(?:soth|sout|souht|suoth|sotuh)(?=(?:bound|ern)?\b)", "south"),
        (r"\b(?:esat|aest|eas)(?=(?:bound|ern)?\b)", "east"),
        (r"\b(?:wset|wets|wes|ewst)(?=(?:bound|ern)?\b)", "west"),
        (
            r"\b(?:should|ought to|was supposed to|were supposed to) have "
            r"(yielded|given way|stopped|waited|braked)\b",
            r"did not \1",
        ),
        (r"\b\d{1,3}[- ]years?[- ]olds?\b", " "),
        (
            r",?\s+(?:driven|operated|piloted|steered) by\s+(?:(?:an?|the|his|her|its)\s+)?"
            r"(?:[a-z]+\s+){0,3}?"
            r"(?:man|woman|male|female|driver|person|teenager|student|motorist)\b,?",
            " ",
        ),
        (
            r"\b(com|turn|go|head|driv|cross|walk|wait|stopp|runn|hitt|mak|yield|follow|speed)in\b'?",
            r"\1ing",
        ),
        (r"\bgonna\b", "going to"),
        (r"\bwanna\b", "want to"),
        (r"\b(?:da|teh|th)\b", "the"),
        (r"\blite\b", "light"),
        (r"\b4 (?=the\b|a\b|an\b)", "for "),
        (r"\b(yields?|gives? way|stops?|stopping|waits?) (?:2|4) (?=[a-z])", r"\1 for "),
        (r"\bveh(\d)", r"vehicle \1"),
        (r"\bv(?:ehicle)?[ _-]?#?(\d)\b", r"vehicle \1"),
        (r"\bp(?:ed)?[ _-]?#?(\d)\b", r"pedestrian \1"),
        (r"\b(car|truck|bus|vehicle|ped|pedestrian|unit|v|p)[ _-]?#?(\d)\b", r"\1 \2"),
        (
            r"\b(run|runs|ran|running|knock(?:s|ed|ing)?|mow(?:s|ed|ing)?|strik(?:es|"
            r"ing)|let|lets|letting) ((?:the |a )?(?!and\b|then\b|over\b|down\b|by\b|"
            r"through\b|into\b|straight\b|off\b|out\b|right\b|past\b)[a-z]+) (over|down|"
            r"through|by)\b(?! (?:a|the) (?:red|light))",
            r"\1 \3 \2",
        ),
        (r"\bj[- ]?walk", "jaywalk"),
        (r"&|\+", " and "),
        (r"@", " at "),
        (r"~", " "),
    )
)
_NOUNS = (
    "[Vv]ehicle", "[Cc]ar", "[Tt]ruck", "[Bb]us", "[Dd]river", "[Uu]nit", "[Pp]edestrian",
    "[Aa]gent", "[Cc]ab", "[Tt]axi", "[Pp]ed", "[Pp]arty", "VEHICLE", "[Vv]eh",
)  # fmt: skip
_NAMED = "".join(rf"(?<!{noun} )" for noun in _NOUNS)
_SLASHED = re.compile(r"\b([NSEWnsew])/([Bb])\b")
_SECOND = re.compile(rf"{_NAMED}(?<![\w.'])B(?= ?[(:,.;=]| [a-z]|$)")
_LETTERED = re.compile(
    rf"{_NAMED}(?<![\w.'])(A(?= ?[(:,.;=]| (?:is|yields|gives|hits|strikes|fails|turns|goes|comes|"
    r"waits|follows|stops|collides|rear|must|has|and|almost|nearly|lets|runs|does|from|\w+bound)\b|$)"
    r"|[B-D](?= ?[(:,.;=]| [a-z]|$))"
)
_TOKEN = re.compile(r"\d+(?:\.\d+)?(?:st|nd|rd|th)\b|\d+(?:\.\d+)?|[a-z]+|[.,;:!?()\[\]|]")
_END = frozenset(".;!?|")
_SOFT = frozenset(",()[]")
_IRREGULAR = {
    "goes": "go", "went": "go", "gone": "go", "came": "come", "drove": "drive", "driven": "drive",
    "ran": "run", "swung": "swing", "bore": "bear", "gave": "give", "took": "take",
    "taken": "take", "held": "hold", "stood": "stand", "rode": "ride",
    "ridden": "ride", "caught": "catch", "kept": "keep", "sped": "speed", "slid": "slide",
    "crept": "creep", "flew": "fly", "shot": "shoot", "swept": "sweep", "strode": "stride",
    "led": "lead", "blew": "blow", "blown": "blow", "drew": "draw", "stuck": "stick",
    "fled": "flee", "lept": "leap", "leapt": "leap", "saw": "see", "seen": "see",
    "broke": "break", "hung": "hang", "sat": "sit", "spun": "spin", "threw": "throw",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Token:
    """A word, a number or a mark; `end` closes a sentence, `soft` a phrase."""

    text: str
    stem: str
    end: bool = False
    soft: bool = False

    @property
    def mark(self) -> bool:
        """True for punctuation."""
        return self.end or self.soft or self.text == ":"


@lru_cache(maxsize=8192)
def stem(word: str) -> str:
    """The Snowball stem of a lower-case word; irregular verbs have that of their infinitive."""
    return stem_word(_IRREGULAR.get(word, word))


def clean(text: str) -> str:
    """The text in lower case with contractions, quotes, dashes and arrows made plain."""
    result = _mark_letters(unicodedata.normalize("NFKC", text)).lower().replace("\r", "\n")
    for pattern, new in _REPLACEMENTS:
        result = pattern.sub(new, result)
    return result


def _mark_letters(text: str) -> str:
    """ "A (northbound) hits B": capital letters that name road users."""
    text = _SLASHED.sub(r"\1\2", text)
    if text.isupper() or not _SECOND.search(text):
        return text
    return _LETTERED.sub(r"unit \1", text)


def split_tokens(text: str) -> list[Token]:
    """Tokens of text that went through `clean`."""
    return [_build_token(word) for word in _TOKEN.findall(text)]


@lru_cache(maxsize=8192)
def _build_token(word: str) -> Token:
    return Token(word, stem(word), end=word in _END, soft=word in _SOFT)
