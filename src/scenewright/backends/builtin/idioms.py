"""Turns of phrase that come down to words the lexicon knows, whoever takes part."""

from __future__ import annotations

import re
from collections.abc import Callable

SIDE = r"(?:north|south|east|west)"
_SIDES = {"n": "north", "s": "south", "e": "east", "w": "west"}
_VEHICLE = (
    r"(?:vehicles?|vehs?|cars?|trucks?|lorry|lorries|bus|buses|taxis?|cabs?|vans?|suvs?|sedans?|"
    r"motorcycles?|motorbikes?|coach|pickup)"
)
_LEG = r"(?:leg|exit|arm|branch|street|road|side)"
BOUND = r"(?:nb|sb|eb|wb|(?:north|south|east|west)bound)"
_EVENT = r"(?:crash|collision|accident|near miss|conflict|t[ -]?bone)"
_PRIORITY = r"(?:priority|precedence|(?:the )?right of way)"
_WHOSE = r"(?:an?|the|its|his|her|their|that|my|your|our)"
_LIGHT = r"(?:traffic |stop ?)?(?:light|signal)s?"
_RED = rf"(?:{_WHOSE} )?(?:own )?(?:clearly |steady |solid |very |already )?red(?: {_LIGHT})?"
_ANY_LIGHT = rf"(?:{_RED}|{_WHOSE} {_LIGHT}|stop ?lights?)"
_IGNORES = (
    r"(?:ignor|disregard|violat|defy|defi|flout|disobey|overlook|skip|beat|bust|r[au]n|jump|"
    r"bl[eo]w|shoot|shot|burn)"
)
_GOES = (
    r"(?:sail|barrel|fl[ye]w?|rac|speed|sped|plo(?:w|ugh)|drov|driv|charg|roar|zoom|cruis|roll|"
    r"coast|slid|go|went|pass|continu|push|power|blast|storm|blow|blew|r[au]n|com|came|shoot|shot)"
)
_NO_NOUN = rf"(?! {_VEHICLE})(?= |[.,;:)]|$)"
_PASSES = (
    r"(?:cross|enter|go|went|driv|drov|proceed|continu|sail|speed|sped|carr|roll|pass|step|walk)"
)
_PLACE = r"(?:(?:the )?(?:stop line|junction|intersection|crossroads|box|road|street|crosswalk))"
_SEVERE = (
    r"(?:particular|notable|noteworthy|special|significant|relevant|unusual|critical|dangerous|"
    r"major|real|actual|adverse|safety[- ]relevant|safety[- ]critical|serious|kind of|sort of|"
    r"type of|rare|hazardous|risky|remarkable|abnormal|untoward|traffic)"
)
_HAPPENING = (
    r"(?:events?|incidents?|interactions?|conflicts?|problems?|occurrences?|situations?|"
    r"happenings?|anomal(?:y|ies)|encounters?)"
)


def _way(match: re.Match[str]) -> str:
    """ "N-S" between words that name a vehicle."""
    first, second = (letter for letter in match.groups() if letter is not None)
    return f"{_SIDES[first]} to {_SIDES[second]}"


def _entry(match: re.Match[str]) -> str:
    """ "car (N, left)"."""
    return f"{match[1]} (from the {_SIDES.get(match[2], match[2])}"


_DEEDS = {"fol": "follows", "yie": "yields to", "col": "collides with", "nea": "nearly hits"} | {
    "hit": "hits"
}
_New = str | Callable[[re.Match[str]], str]
_PLAIN: tuple[tuple[re.Pattern[str], _New], ...] = tuple(
    (re.compile(pattern), new)
    for pattern, new in (
        # What it is for is no part of it.
        (
            r"^\W*(?:for|to) (?:train|test|evaluat|benchmark|validat|debug|stress|calibrat|"
            r"challeng|assess)\w* [^:,.;]{0,80}[:,]",
            "",
        ),
        # Who goes first.
        (
            rf"\b{_PRIORITY} (is|was|gets|has been) (given|granted|accorded|ceded|yielded|left) to "
            r"((?:[a-z]+ ){1,6}?)by ",
            r"\3\1 given priority by ",
        ),
        (
            rf"\b(?:gets|got|receives?|received|enjoys|is given|has) {_PRIORITY} (?:from|by)\b",
            "is given priority by",
        ),
        (
            rf"\b(?:gets|got|receives?|received|enjoys|gains|keeps) {_PRIORITY} over\b",
            "has priority over",
        ),
        (
            r"\b(?:motion|beckon|gestur|nodd?|usher|signall?)(?:e?s|e?d|ing)?"
            r" ((?:[a-z]+ ){1,3}?)(across|through|past|on|over|"
            r"to (?:cross|go|pass|walk|proceed))\b(?! (?:the|a) )",
            r"waves \1\2",
        ),
        (
            r"\b(yield\w*|giv\w+ way) to (?:nobody|no one|none|nothing)\b",
            "does not yield",
        ),
        (r"\b(yields?|yielding|gives? way|giving way|stops?|waits?) first (?=to |for )", r"\1 "),
        (
            r"\bonly ((?:goes|go|drives|moves|turns|proceeds|continues|starts|enters|sets off)\b"
            r"[^.,;]{0,30}?) (once|after|when|as soon as)\b",
            r"\1 only \2",
        ),
        (
            r"\b(goes|drives|moves|proceeds|continues|starts|sets off) (after|once)"
            r"(?= (?:[a-z]+ ){1,4}?(?:has|have|had) (?:crossed|passed|gone|cleared|left|finished))",
            r"\1 only \2",
        ),
        # Who is hit, and how close it gets.
        (
            r"\b(?:narrowly |barely |just |only just )?(?:miss|avoid|escap|dodg|evad)(?:es|ed|e|s|"
            r"ing)? (?:being|getting) (?=hit|struck|run|knocked|clipped|mown|crushed|rammed)",
            "is almost ",
        ),
        (
            r"\b(?:only just|barely|just about|just|narrowly|hardly) manag\w+ to (?:stop|brake|"
            r"halt)(?: in time)?\b",
            "stops just in time",
        ),
        (
            r"\bby (?:just |only |about |under )*(?:half a|less than (?:a|half a)|\d[\d.]*|"
            r"a fraction of a|a split)[ -]?(?:seconds?|s)\b(?=\s*(?:[.,;!]|and\b|$))",
            "",
        ),
        (
            r"\b(?:send(?:s|ing)?|sent) ((?:[a-z]+ ){1,4}?)"
            r"(?:flying|sprawling|tumbling|to the (?:ground|floor)|into the air)\b",
            r"knocks down \1",
        ),
        (
            r"\b(?:knock|sweep|throw)(?:s|ed|ing)? ((?:[a-z]+ ){1,4}?)(?:off (?:his|her|their|its) "
            r"feet|to the (?:ground|floor)|unconscious)\b",
            r"knocks down \1",
        ),
        (
            r"\bgiv(?:es|ing|e) ((?:[a-z]+ ){1,4}?)a (?:\w+ )?(?:fright|scare|shock|start)\b",
            r"scares \1",
        ),
        (
            r"\b(?:dangerously|perilously|uncomfortably|alarmingly|precariously) close\b",
            "too close",
        ),
        (
            r"\b(?:gets?|got|getting|c[oa]mes?|coming|passe[sd]|drives|goes|went) "
            r"(?:much |far |way )?too close (?:to|by|past)\b(?! for)",
            "narrowly misses",
        ),
        # Straight on into somebody's back is no way through the junction.
        (
            r"\b(go(?:es|ing)?|went|r[ua]ns?|running|driv\w+|drove|slam\w*|crash\w*|plo\w+) "
            r"(?:straight|right|directly|smack|bang|squarely|head first) "
            r"(?=into the (?:back|rear|side|front|tail|flank)\b)",
            r"\1 ",
        ),
        (r"\b(?:is|was) (?:right |directly |just |close(?:ly)? )?behind\b", "follows"),
        (r"\b(?:right|directly|immediately|closely) behind (?=(?:an?|the|another)\b)", "behind "),
        # Who does not give way.
        (
            r"\b(?:should|ought to|is supposed to|was supposed to|has to|had to|must) "
            r"((?:yield|give way|stop|wait|brake)\b[^.;]*?),? but (?:it |he |she |they )?"
            r"(?:does not|did not|do not|fails to|failed to|is not)\b(?: do (?:so|it|that))?",
            r"does not \1",
        ),
        (
            r"\bneither of (?:the |these )(two [a-z]+) "
            r"(?:yields?|gives? way|stops?|brakes?)(?= ?(?:[:;,.]|and\b|so\b))",
            r"\1",
        ),
        # Red lights.
        (
            rf"\b(?:despite|in spite of|notwithstanding) {_RED}",
            "against the red light",
        ),
        (
            r"\b(?:while|although|though|even though|when|despite) "
            rf"(?:facing|having|showing|seeing) {_RED}",
            "against the red light",
        ),
        (
            r",? (?:although|though|even though|while|despite the fact that)"
            rf" {_WHOSE} (?:traffic )?(?:light|signal)s? (?:is|was|are|shows?|showed|has turned|"
            r"had turned|turned)(?: still| already| clearly)? red\b",
            " against the red light",
        ),
        (
            r"\b(?:the )?(?:red man|red figure|red hand|do not walk(?: sign| signal)?)\b",
            "the red light",
        ),
        (rf"\b{_IGNORES}[a-z]*ing {_ANY_LIGHT}{_NO_NOUN}", "ignoring the red light"),
        (
            rf"\b{_GOES}[a-z]*ing (?:straight |right |just )?(?:through|past|across) "
            rf"{_RED}{_NO_NOUN}",
            "ignoring the red light",
        ),
        (
            rf"(?<!not )(?<!to )\b{_IGNORES}(?!\w*ing\b)[a-z]* {_ANY_LIGHT}{_NO_NOUN}",
            "ignores the red light",
        ),
        (
            rf"(?<!not )(?<!to )\b{_GOES}(?!\w*ing\b)[a-z]* (?:straight |right |just )?"
            rf"(?:through|past|across) {_RED}{_NO_NOUN}",
            "ignores the red light",
        ),
        (
            rf"(\b{_PASSES}[a-z]*(?: straight| on| over| ahead)*(?: {_PLACE})?) "
            r"(?:on|at|against) (?:a )?red\b(?! (?:light|signal))",
            r"\1 against the red light",
        ),
        # Nothing happens.
        (
            rf"\b(?:no|without(?: any)?|zero|not any|nothing in the way of) "
            rf"(?:{_SEVERE} )+{_HAPPENING}",
            "without any incident",
        ),
        # Traffic engineers' shorthand.
        (rf"\b({BOUND}) (?:lt|l/t)\b", r"\1 left"),
        (rf"\b({BOUND}) (?:rt|r/t)\b", r"\1 right"),
        (  # "th" has been taken for a slip of "the"
            rf"\b({BOUND}) (?:th|the)(?=\s*(?:/|vs\b|versus\b|x\b|near\b|crash|collision|"
            r"conflict|[,.;]|$))",
            r"\1 thru",
        ),
        (rf"\blt(?= {_VEHICLE}\b)", "left turning"),
        (rf"\brt(?= {_VEHICLE}\b)", "right turning"),
        (r"\blt\b", "left turn"),
        (r"\brt\b", "right turn"),
        (
            rf"\b({BOUND} (?:left|right|thru|through|straight))\s*/\s*(?={BOUND}\b)",
            r"\1 vs ",
        ),
        (
            rf"\b({_EVENT})\W+({BOUND}) (?:and|vs|versus|x|with) ({BOUND})\b(?=\s*(?:[,.;]|$))",
            r"\1 between a \2 vehicle and a \3 vehicle",
        ),
        (
            rf"(^\W*|[.;] )(left|right) turn(?:er)? from (?:the )?({SIDE}),?"
            r" (?=hits|strikes|yields|gives|nearly|almost|waits|fails|misses|collides)",
            r"\1a vehicle turning \2 from the \3 ",
        ),
        (
            r"\b(?:vehicles|agents|actors|participants|pedestrians|road users)\s*[:=]\s*\d+\s*"
            r"(?=\()",
            "",
        ),
        (
            r"\b(follows?|yields?(?: to)?|collides?|collision|near miss|hits?)"
            r"\(\s*([^(),]{2,60}),\s*([^(),]{2,60})\)",
            lambda m: f"{m[2]} {_DEEDS[m[1][:3]]} {m[3]}",
        ),
        (r"\b([nsew])[- ]bound\b", lambda m: f"{_SIDES[m[1]]}bound"),
        (r"\b(\d{1,2}|noon|midday|midnight)[- ]?ish\b", r"\1"),
        (
            r"(^\W*|[.;]\s*)(?:first(?:ly)?|second(?:ly)?|third(?:ly)?|next|then|finally|lastly),\s",
            r"\1",
        ),
        (
            r"\b(?:fill|populate|stock|dress) the (?:background|rest(?: of the scene)?) with"
            r" (?=\d|[a-z]+ (?:vehicles|cars|pedestrians))",
            "background: ",
        ),
        # Everybody at once.
        (
            rf"\b(?:one|an?|1) ({_VEHICLE}) (?:from|on|at) each (?:of the four )?"
            r"(?:direction|side|approach|leg|arm)s?\b",
            r"a \1 from the north, a \1 from the east, a \1 from the south and a \1 from the west",
        ),
        (
            rf"\bfrom opposite (?:ends|sides|directions|approaches|legs),? \(?(?:namely )?"
            rf"(?:the )?({SIDE}) and (?:the )?({SIDE})\b\)?",
            r"from the \1 and the \2",
        ),
        (
            rf"\bon the ({SIDE}) and (one|another|a second|the other)(?: one)? on the ({SIDE}) "
            r"(crosswalk|crossing|leg)\b",
            r"on the \1 \4 and \2 on the \3 \4",
        ),
        # Corners.
        (
            r"\b(?:the )?(n|s|north|south)[- ]?(e|w|east|west)(?:ern)?[- ]corner\b",
            lambda m: f"the {_SIDES.get(m[1], m[1])}{_SIDES.get(m[2], m[2])} corner",
        ),
        # Where from, where to.
        (r"\bfrom (?:below|underneath|beneath)\b(?! (?:the|a) )", "from the south"),
        (r"\bfrom above\b(?! (?:the|a) )", "from the north"),
        (
            rf"\b(?:bound|destined|headed|heading|head|heads|making|makes|aiming|aims) for the "
            rf"({SIDE})(?:ern)? {_LEG}\b",
            r"leaving to the \1",
        ),
        (
            rf"\b(?:bound|destined|on (?:its|his|her|their) way) (?:for|to) the ({SIDE})\b",
            r"leaving to the \1",
        ),
        (
            rf"\b(?:head|travel|go|driv|mov|proceed)\w* (?:to|for|towards?) (?:the )?({SIDE})"
            rf"(?: {_LEG})?,? (?:coming |arriving |entering |starting |approaching )?"
            rf"from (?:the )?({SIDE})\b",
            r"from the \2 leaving to the \1",
        ),
        (
            rf"\b({_VEHICLE}(?: \w)?) \((?:from )?({SIDE}|[nsew])(?=\s*[,;)])",
            _entry,
        ),
        (
            rf"\b([nsew])-([nsew])(?= (?:\w+ )?{_VEHICLE}\b)|(?<=[a-z\d] )([nsew])-([nsew])\b",
            _way,
        ),
    )
)


def plain(text: str) -> str:
    """Clean text with idioms in words that the lexicon knows."""
    for pattern, new in _PLAIN:
        text = pattern.sub(new, text)
    return text
