"""What kind of turn words are: a question, a step between versions, small talk, or words to act on.

The form of a sentence alone decides the kind, for every backend alike, so that a question never
changes a scene. What is left, requests and descriptions, is read by the planner.
"""

from __future__ import annotations

import re
from typing import Literal, cast

from scenewright.scene.base import Model

Kind = Literal[
    "question",
    "undo",
    "redo",
    "version",
    "restart",
    "show",
    "why",
    "help",
    "quit",
    "play",
    "gif",
    "mp4",
    "html",
    "save",
    "talk",
    "words",
]

_NUMBERS = {
    "one": 1, "once": 1, "a": 1, "two": 2, "twice": 2, "three": 3, "four": 4, "five": 5, "six": 6,
    "first": 1, "second": 2, "third": 3, "fourth": 4, "fifth": 5, "sixth": 6,
}  # fmt: skip
_COUNT = rf"(?P<count>\d{{1,3}}|{'|'.join(_NUMBERS)})"
_NTH = _COUNT.replace("count", "nth")
_POLITE = re.compile(
    r"^(?:please|pls|ok(?:ay)?|so|well|hey|hi|hello|now|and|but|no|nah|nope|wait|yes|yeah|yep|oh|"
    r"h+m+|w(?:oah|hoa|ow)|uh|um+|sorry|actually|alright|fine|great|good|cool|nice|too close|"
    r"thanks?|lol|haha)\b[ ,!.…]*"
)
_AFTER = re.compile(r"[ ,]+(?:please|pls|then|thanks|now|though)[ .!]*$")
_ASKS_TO_ACT = re.compile(
    r"^(?:can|could|would|will)(?: you| we| i)?(?: please)? "
    r"(?:make|add|remove|delete|drop|slow|speed|stop|put|set|move|change|turn|delay|replace|have|"
    r"let|"
    r"give|get|show|create|generate|do|try|redo|undo|go)\b|^(?:how|what) about\b|^what if\b|"
    r"^why (?:not|don't|do not)\b|"
    r"^(?:can|could|would|will) (?:the(?: (?!have\b)[a-z-]+){1,3}|it|he|she|they|a|an) (?!have\b)"
)
_ASKING = (
    r"how|whom?|whose|what|what's|when|where|which|why|is|are|isn't|aren't|does|do|did|doesn't|"
    r"didn't|was|were|has|had"
)
_QUESTION = re.compile(
    rf"^(?:{_ASKING}|have you|what if it (?:was|were|is|had been) (?:rain|snow|wet)|"
    r"(?:by|at|in|on|from|to|for|with|under) (?:how|what|which|whose|whom)\b|"
    r"(?:can|could|would|will|should|did) (?:the(?: [a-z-]+){1,3}|it|he|she|they) have\b|"
    r"(?:can|could|may) i\b|any(?:body|one)? \w+.*\?$|"
    r"tell me (?:how|who|what|when|where|which|why|if|whether|about))\b"
)
_WHY_REFUSED = (
    r"(?:why|how come|explain|what went wrong|what was wrong|for what reason)"
    r"(?: (?:not|was (?:that|it|this) refused|did (?:that|it|this) fail|"
    r"did you refuse(?: (?:that|it|this|me))?|(?:that|this)|so))?"
)
_STEPS = r"(?: (?:steps?|times|versions?|changes?|turns?))?"
_THANKS = r"thanks?(?: you)?(?: (?:so|very) much| a lot)?"
_GREETING = r"hello(?: there)?|hi(?: there)?|hey|good (?:morning|evening|afternoon|day)"
_PRAISE = (
    r"(?:(?:that'?s|thats|it'?s|this is|that is|looks|very|really|so|pretty|quite|super|not|too|"
    r"all) )*"
    r"(?:great|nice|cool|perfect|awesome|wow|fine|good(?: job)?|it|unrealistic|realistic|weird|"
    r"odd|strange|"
    r"stupid|wrong|bad|boring|funny|better|interesting|right|brilliant|amazing|ok(?:ay)?)(?: "
    r"enough)?|"
    r"well done|lol|haha|h+m+|i see|got it|i (?:really )?(?:do ?n[o']?t|do) (?:like|want|get|"
    r"understand) (?:it|that|this)|"
    r"(?:the|that|this|never ?mind)(?: [a-z]+)? obviously|never ?mind|w(?:oah|hoa|ow)|no|yes|"
    r"nope|yeah"
)
_SIMPLE: tuple[tuple[Kind, re.Pattern[str]], ...] = tuple(
    (cast(Kind, kind), re.compile(rf"^(?:{pattern})[ .!?]*$"))
    for kind, pattern in (
        ("why", _WHY_REFUSED),
        ("version", r"(?:go |take me |return |switch )?(?:back )?(?:to )?(?:the )?"
                    rf"(?:version (?:number )?{_COUNT}|{_NTH} (?:version|one|scene))"),
        ("undo", rf"(?:(?:go )?back to )?(?:as|how|what|like) it was(?: {_COUNT} (?:steps?|"
                 rf"versions?|changes?) "
                 r"ago| before)?|(?:the )?(?:previous|last) (?:version|one)"),
        ("undo", r"(?:undo|revert|go back|step back|back|take (?:that|it|this) back)"
                 rf"(?: (?:by |the last |that |it |this )*(?:{_COUNT}{_STEPS}|"
                 r"(?:step|version|change|turn|that|it|this|one))?)?|"
                 r"undo (?:it|that|this) all"),
        ("redo", r"(?:redo|go forward|forward|again forward)(?: (?:that|it))?"),
        ("restart", r"(?:let's |let us )?(?:start|begin) (?:over|again|anew|afresh|from scratch)|"
                    r"from scratch|new scene|(?:a )?clean slate|"
                    r"forget (?:it|that|everything|the scene)|reset|"
                    r"(?:delete|remove|clear|erase) (?:everything|all|it all|the (?:whole )"
                    r"?scene)"),
        ("play", r"(?:(?:can|could|may) (?:i|we|you) )?(?:play|watch|open|see|view)(?: (?:it|"
                 r"this|that|the (?:scene|"
                 r"video|animation)))?(?: again| from above| in (?:the|my) browser)*"),
        ("gif", r"(?:(?:can|could) (?:you|i) )?(?:save|export|make|write|get)(?: me)? (?:it|this|"
                r"that|a|an?)?(?: ?as)?"
                r"(?: an?)? ?(?:gif|animation)(?: of (?:it|this|that))?"),
        ("mp4", r"(?:(?:can|could) (?:you|i) )?(?:save|export|make|write|get)(?: me)? (?:it|this|"
                r"that|an?)?(?: ?as)?"
                r"(?: an?)? ?(?:mp4|video|movie|film)(?: of (?:it|this|that))?"),
        ("html", r"(?:(?:can|could) (?:you|i) )?(?:save|export|share|send|write)(?: me)? (?:it|"
                 r"this|that)"
                 r"(?: as an? (?:html|page|web ?page|link|file)| with .{1,40}| to .{1,40})"),
        ("save", r"(?:(?:can|could) (?:you|i|we) )?(?:save|export|download|keep)(?: (?:it|this|"
                 r"that|the scene))?"),
        ("show", r"(?:show|describe|summari[sz]e|display)(?: me)?"
                 r"(?: (?:it|this|that|the (?:scene|version|result)))?(?: again)?"),
        ("help", r"help|help me|commands"),
        ("quit", r"quit|exit|bye|good ?bye|see you"),
        ("talk", rf"{_THANKS}|{_GREETING}|{_PRAISE}"),
    )
)  # fmt: skip


class TurnKind(Model):
    """The kind of a turn.

    Attributes:
        count: how many steps back; number: of the version that is asked for.
        words: what is left to be read, without the polite frame of a request.
        topic: what a question is about, as the model of turns names it; None where that is open.
    """

    kind: Kind
    words: str
    count: int = 1
    number: int | None = None
    topic: str | None = None


def classify_turn(words: str) -> TurnKind:
    """The kind of the words, by their form."""
    whole = " ".join(words.lower().replace("’", "'").split())
    plain = whole
    while (bare := _POLITE.sub("", _AFTER.sub("", plain), count=1)) != plain and bare:
        plain = bare
    for candidate in (whole, plain):
        for kind, pattern in _SIMPLE:
            found = pattern.match(candidate)
            if found is not None:
                return _describe(kind, words, found)
    if _ASKS_TO_ACT.match(plain):
        return TurnKind(kind="words", words=_drop_frame(words))
    if _QUESTION.match(plain) or re.match(r"the [a-z-]+ ?\?$", plain):
        return TurnKind(kind="question", words=words)
    return TurnKind(kind="words", words=_drop_frame(words))


def _describe(kind: Kind, words: str, found: re.Match[str]) -> TurnKind:
    groups = found.groupdict()
    digits = groups.get("nth") or groups.get("count")
    number = None if digits is None else int(_NUMBERS.get(digits, digits))
    if kind == "version":
        return TurnKind(kind=kind, words=words, number=number)
    return TurnKind(kind=kind, words=words, count=number or 1)


_SHOW = r"show me (?=an? |two |three |the )"
_WISH = r"i(?: would|'d) like (?:to see )?(?=an? )|i want (?:to see )?(?=an? )|what if "
_REQUEST = r"(?:can|could|would|will) (?:you|we)(?: please)? "
_FRAME = re.compile(rf"^\s*(?:please )?(?:{_REQUEST})?(?:{_SHOW}|{_WISH})?", re.IGNORECASE)
_SUPPOSE = re.compile(r"^\s*what if (it|the [a-z]+) (?:were|was|is|became) ", re.IGNORECASE)


def _drop_frame(words: str) -> str:
    """ "Show me a car that yields" and "can you make the car faster?" without their frames."""
    bare = _FRAME.sub("", _SUPPOSE.sub(r"make \1 ", words), count=1)
    return bare.rstrip(" ?") if bare != words else words
