"""Instruction text -> plain lower-case text."""

from __future__ import annotations

import re
import unicodedata

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
        (rf"\b[a-z]+'s (?=(?:[a-z]+ )?(?:{_OWNED})\b)", ""),
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
        (r"\b\d{1,3}[- ]years?[- ]olds?\b", " "),
        (
            r"\b(com|turn|go|head|driv|cross|walk|wait|stopp|runn|hitt|mak|yield|follow|speed)in\b'?",
            r"\1ing",
        ),
        (r"\bgonna\b", "going to"),
        (r"\bwanna\b", "want to"),
        (r"\b(?:da|teh|th)\b", "the"),
        (r"\blite\b", "light"),
        (r"\bveh(\d)", r"vehicle \1"),
        (r"\bv(?:ehicle)?[ _-]?#?(\d)\b", r"vehicle \1"),
        (r"\bp(?:ed)?[ _-]?#?(\d)\b", r"pedestrian \1"),
        (r"\b(car|truck|bus|vehicle|ped|pedestrian|unit|v|p)[ _-]?#?(\d)\b", r"\1 \2"),
        (r"\bj[- ]?walk", "jaywalk"),
        (r"&|\+", " and "),
        (r"@", " at "),
        (r"~", " "),
    )
)


def clean(text: str) -> str:
    """The text in lower case with contractions, quotes, dashes and arrows made plain."""
    result = unicodedata.normalize("NFKC", text).lower().replace("\r", "\n")
    for pattern, new in _REPLACEMENTS:
        result = pattern.sub(new, result)
    return result
