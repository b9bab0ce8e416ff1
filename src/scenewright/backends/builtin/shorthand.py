"""Ways of putting things that come down to plainer ones: lists, shorthand, roundabout places."""

from __future__ import annotations

import re

from scenewright.backends.builtin import idioms
from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.idioms import BOUND, SIDE

_NUMBER = (
    r"(?:\d{1,2}|no|zero|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|fifteen|"
    r"twenty|a dozen)"
)
_VEHICLES = r"(?:vehicles?|vehs?|cars?|trucks?|buses|taxis|vans)"
_WALKERS = r"(?:pedestrians?|peds?|people|persons?|walkers?)"
_COUNTED = rf"(?:{_VEHICLES}|{_WALKERS})"
_ACTION = r"(?:yields?|gives? way|hits?|strikes?|collides?|crashes|rear|near|almost|follows?)"
_PLACE = r"(?:crosswalk|crossing|leg|arm|road|street|avenue)"
_GOES_IN = (
    r"(?:enter\w*|turn\w* (?:on|in)to|driv\w+ (?:over|across|onto|into)|cross(?:es)?|"
    r"pass\w* over|go\w* (?:over|across|into)|leav\w+ (?:by|via|on|through)|exit\w* (?:by|via|on))"
)
_WOULD = r"(?:(?:has|have|needs|wants|is about|is going) to|must|will|is|was)"
_EXIT_CROSSWALK = re.compile(
    rf"\b(?:the |a )?(?:crosswalk|crossing) (?:of|on|at|across|over) (?:its|his|her|their|the) exit"
    rf"(?: leg| side| road| arm)?\b"
    r"|\b(?:its|the|his|her) exit (?:(?:leg|road|arm|side)s? )?(?:crosswalk|crossing)\b"
    rf"|\b(?:the |a )?(?:(?:crosswalk|crossing) (?:of|on|at|across|over) )?the"
    rf" (?:same )?{_PLACE} (?:that |which )?(?:it|he|she|the [a-z]+)(?: {_WOULD})* {_GOES_IN}"
    rf"(?: (?:at|on) (?:its|his|her|the) exit)?\b"
)
_COMES_BY = (
    r"(?:com\w+ (?:from|in (?:on|by))|approach\w* (?:on|from|along)|start\w* (?:from|on)|enter\w* "
    r"(?:from|by|on)|arriv\w* (?:from|on|by))"
)
_ENTRY_CROSSWALK = re.compile(
    r"\b(?:the |a )?(?:crosswalk|crossing) (?:of|on|at|across|over) (?:its|his|her|their|the)"
    r" (?:own )?(?:entry|approach|entrance)(?: leg| side| road| arm)?\b"
    r"|\b(?:its|the|his|her) (?:own )?(?:entry|approach|near|near-side|near side)"
    r"(?: (?:leg|road|arm|side)s?)? (?:crosswalk|crossing)\b"
    rf"|\b(?:the |a )?(?:crosswalk|crossing) (?:of|on|at|across|over) the {_PLACE}"
    rf" (?:that |which )?(?:it|he|she|the [a-z]+)(?: {_WOULD})* {_COMES_BY}\b"
)
_THAT_LEG = re.compile(
    r"\b(?:(?:the|a) )?(?:crosswalk|crossing) (?:of|on|at|across|over) (?:that|the same|this)"
    r" (?:leg|arm|side|road|exit)\b"
    r"|\bthat (?:leg|arm|road|side|exit) s? ?(?:crosswalk|crossing)\b"
)
_NAMED_SIDE = re.compile(rf"\b{SIDE}\b")
_BACKGROUND_LIST = re.compile(
    r"\b(?:in the )?(?:background|bg|others|extras)(?: only)?"
    r"(?: (?:traffic|agents|road users|actors))?"
    rf"(?:\s*[:=]\s*|\s+(?=\d))({_NUMBER} [^.;|:]*)"
)
_COUNT = re.compile(rf"\b({_NUMBER}) ((?:[a-z]+ )?{_COUNTED})\b")
_LABELLED_COUNT = re.compile(
    rf"\b(?:background|bg) ({_COUNTED})\s*[:=]\s*({_NUMBER}|none)\b(?!\s*[:.]\d)"
)
_SHARED_BACKGROUND = re.compile(
    rf"\b({_NUMBER} background {_COUNTED})(,? and|,|,? plus)(?: also)? ({_NUMBER}) ({_COUNTED})\b"
    r"(?! (?:cross|on |who|walk|step|jaywalk|from|turn|driv|go|hit|yield|collid|follow))"
)
_MOVES = {
    "left": "turning left", "lt": "turning left", "right": "turning right", "rt": "turning right",
    "thru": "going straight", "through": "going straight", "straight": "going straight",
}  # fmt: skip
_MOVE = rf"(?:{'|'.join(_MOVES)})"
_VERSUS = re.compile(
    r"(?<!follower )(?<!leader )(?<!vehicle )(?<!car )(?<!bus )(?<!truck )(?<!van )"
    rf"\b({BOUND})[ -]({_MOVE})(?=\s*(?:vs|versus|x|against)\b|\s+{_ACTION}\b)"
    rf"|(?<=vs )({BOUND})[ -]({_MOVE})\b(?! ?-?turn)"
    rf"|(?<=versus )({BOUND})[ -]({_MOVE})\b(?! ?-?turn)"
    rf"|(?:(?<=to )|(?<=by )|(?<=with )|(?<=hits )|(?<=and ))({BOUND})[ -]({_MOVE})\b"
    r"(?=\s*(?:[,.;)]|$))"
)
_OPENS = re.compile(rf"(^\W*|[.;:] )({BOUND})[ -]({_MOVE})(?=\s*[,;])")
_BOTH_BOUND = re.compile(
    rf"\b({BOUND}) and ({BOUND})[ -]({_MOVE})(?:[ -]turn(?:s|ers?)?|s)?(?=\s*(?:[,.;:)]|$))"
)
_OF_MAP = re.compile(
    r"\b(?:the )?(left|right|top|bottom|upper|lower)(?:[ -]hand)?(?: side| edge| end| part)? of"
    r" (?:the |my )?(?:map|screen|picture|image|frame|view|diagram|drawing)\b"
)
_MAP_SIDES = {
    "left": "west", "right": "east", "top": "north", "upper": "north",
    "bottom": "south", "lower": "south",
}  # fmt: skip
_MAP_WORDS = re.compile(r"\bfrom (?:the )?(?:top|bottom)\b")
_FROM_SIDE = re.compile(r"\bfrom (?:the )?(left|right)\b(?! (?:of|side|lane|turn|hand))")
_EGO_AND_OTHER = re.compile(r"\bego\b.*\bother ?:")
_OTHER = re.compile(r"\b(?:the )?other(?= ?[:.;,]| (?:yields|gives|hits|goes|turns|stops)\b|$)")
_CHAIN = r"(?:platoon|convoy|chain|line|row|string|column|queue|procession|file|train)"
_EACH_BEHIND = (
    r"each(?: one| of them| car| vehicle)? (?:follow\w*|trail\w*|tail\w*|driv\w+ behind|behind)"
    r" the (?:(?:one|car|vehicle) )?(?:right |directly )?"
    r"(?:ahead|in front|before it|preceding one|preceding car|previous one|previous car)"
    r"(?: of (?:it|them))?"
)
_EVENT = (
    r"(?:accidents?|collisions?|crash(?:es)?|near[- ]miss(?:es)?|incidents?|conflicts?|events?|"
    r"interactions?|close calls?|yielding)"
)
_SIMPLE: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(pattern), new)
    for pattern, new in (
        (r"\bnear-?miss(?=\w*)", "near miss"),
        (r"\bstrai(?:t|hgt|gth|gt)\b|\bstraigt\b|\bstright\b", "straight"),
        (r"\bcomm(?=ing\b)", "com"),
        (r"\bas well\b(?! as)", ""),
        (r"(?<=[a-z\d])\s*=\s*(?=[a-z\d])", ": "),
        (
            rf"\b(run|walk|jog)(s|ning|ing)? over (?=the (?:{SIDE}(?:ern)? )?"
            r"(?:crosswalk|crossing|leg|street|road)\b)",
            r"\1\2 across ",
        ),
        (
            r"\bneither of (?:the )?(two [a-z]+) (?:yields?|gives? way|stops?|brakes?)(?= ?[:;,])",
            r"\1",
        ),
        (
            r"\bfrom the north(east|west)(?: corner)? to the south\1 corner\b",
            r"across the \1 leg from north to south",
        ),
        (
            r"\bfrom the south(east|west)(?: corner)? to the north\1 corner\b",
            r"across the \1 leg from south to north",
        ),
        (
            r"\bfrom the (north|south)west(?: corner)? to the \1east corner\b",
            r"across the \1 leg from west to east",
        ),
        (
            rf"\ban? (?:[a-z]+ ){{0,2}}(?:{_VEHICLES}|{_WALKERS}|bus|suv|taxi|van|man|woman),?"
            r" (?:no |er |uh )?,? ?"
            r"(?:sorry|i mean|i meant|make that|or rather|no wait|wait no),? (?=an? )",
            "",
        ),
        (
            r"(?<= |,)((?:the|a|another) [a-z]+) (?:right |directly )?behind the [a-z]+"
            r"(?= (?:can|does|fails|brakes|hits|crashes|rear|runs|slams|collides|bumps|strikes)\b)",
            r"\1 behind it",
        ),
        (r"\bno yield to\b", "does not yield to"),
        (rf"\b(on|to|by|via|at|through) the ({SIDE})(?:ern)? one\b", r"\1 the \2 leg"),
        (r"^\W*(follow(?:ing)?|yield(?:ing)?)\s*[,;]", r"\1:"),
        (r"\bnothing (?:should|must|shall|will|is to|is going to|may) happen\b", "nothing happens"),
        (
            rf"\b(?:no|without(?: any)?|free of(?: any)?) {_EVENT}"
            rf"(?:(?:,? or|,? and|,? nor|,)(?: any| no| without)? {_EVENT})+",
            "without any incident",
        ),
        (r"\b(another|a second|a third|a further) one there\b", r"\1 pedestrian there"),
        (r"\b(?:the )?far(?:[- ]side)? (?:crosswalk|crossing)\b", "the exitwalk"),
        (
            rf", each(?: of them)?(?= (?:{BOUND}|going|driving|heading|travell?ing|turning)\b)",
            ", all of them",
        ),
        (
            r"\b(turn(?:s|ed|ing)?) right (?=(?:at|before|after|when|as|in|next|now)\b)",
            r"\1 rightwards ",
        ),
        (
            rf"\b(?:two|2) ({BOUND} |oncoming )?(?:vehicles|cars|motorists),? (?:namely )?"
            r"an? ([a-z]+) and an? ([a-z]+)(?=,| (?:are|is|collide|go|drive|turn|almost|nearly)\b)",
            r"a \1\2 and a \1\3",
        ),
        (
            r"\b(a|the|baseline|video|short|traffic|this|normal|simulation) clip\b"
            r"(?= (?:of|with|without|where|showing|in|for|at|from)\b|[ .,;:]*$)",
            r"\1 scene",
        ),
        (
            r"^\W*(?:an? )?(?:\d|two|three|four|five|multi|several)[- ](?:vehicle|car)s?[- ]"
            r"(?:pile[- ]?up|crash|collision|accident|wreck|chain reaction)(?: crash)?\s*:",
            "collision:",
        ),
        (
            r"\b(?:complete|finish|begin|start|attempt|initiate|execute) "
            r"(?:its|his|her|their|the|a) (left|right) turn\b",
            r"turn \1",
        ),
        (
            r"\b(?:complet|finish|beginn|start|attempt|initiat)ing "
            r"(?:its|his|her|their|the|a) (left|right) turn\b",
            r"turning \1",
        ),
        (
            r"\b(wait|waits|waited|holds off|hold off|pauses|stops|delays) (?:with|on|before) "
            r"(?:making |starting )?(?:its|his|her|their|the|a) (left|right) turn\b",
            r"\1 to turn \2",
        ),
        (rf"\b(?:an?|the) {_CHAIN} of ({_NUMBER}(?: \w+)? {_COUNTED})(?= ?:)", r"\1"),
        (
            rf"\b(?:an?|the) {_CHAIN} of ({_NUMBER}(?: \w+)? {_COUNTED})(?:,? {_EACH_BEHIND})?",
            r"\1 in a platoon",
        ),
        (rf",? {_EACH_BEHIND}", " in a platoon"),
        (rf"(in a platoon\b.*?),?(?: in a platoon| {_EACH_BEHIND})", r"\1"),
        (r"\bin a (?:chain|row|column|string|queue)\b", "in a platoon"),
        (
            rf", all(?: of them| three| four)?(?= (?:{BOUND}|going|driving|heading|travell?ing|"
            r"coming|straight|turning|from)\b)",
            ", all of them",
        ),
        (rf"(?<=, )((?:both|all)(?: of them)? {BOUND}) and (?=straight\b)", r"\1 and going "),
        (
            rf"\b(?:and )?so (?:does|do|did|is|was) (the|a|an) ((?:{BOUND} )?[a-z]+)\b",
            r"and \1 \2 does the same",
        ),
        (r"\bfew(?:er)? (?:other )?road users\b", "few cars"),
        (r"\b(?:its|his|her|their) (left|right)[- ](?:hand )?turn\b", r"a \1 turn"),
    )
)
_BOTH_WAYS = re.compile(
    r"\b(left|right|straight)(?: turn)? and (?:also )?(?:turn\w* |goes |go )?"
    r"(left|right|straight)\b"
    r".{0,12}?\b(?:(?:at|in) (?:the )?(?:very )?same (?:time|moment|instant)|simultaneously|at "
    r"once|"
    r"together)\b"
)
_NOTHING_IN_WHICH = re.compile(
    r"\b(?:without(?: any)?|no|zero) (?:other )?(?:interactions?|events?|incidents?|conflicts?|"
    r"collisions?|accidents?|crash(?:es)?)(?: at all| whatsoever)? (?:in which|where|in that)\b"
    r"|\b(?:completely|entirely|perfectly|totally|absolutely) (?:normal|uneventful|ordinary)\b"
    r"[^.;]* (?:in which|where)\b"
)
_NONE_AT_ALL = re.compile(
    rf"\b(?:no|without(?: any)?|zero) ({_VEHICLES}|{_WALKERS}|traffic)"
    r"(?: at all| whatsoever| of any kind)\b"
)


def expand(text: str) -> str:
    """Clean text with lists, shorthand and roundabout places in plainer words.

    Raises:
        Refused: a vehicle is to turn both ways at once.
    """
    both = _BOTH_WAYS.search(text)
    if both and both[1] != both[2]:
        raise Refused("contradictory", "One vehicle cannot go two ways at once; keep one of them.")
    text = idioms.rewrite_idioms(text)
    for pattern, new in _SIMPLE:
        text = pattern.sub(new, text)
    if _MAP_WORDS.search(text):
        text = _FROM_SIDE.sub(lambda match: f"from the {_MAP_SIDES[match[1]]}", text)
    if _EGO_AND_OTHER.search(text):
        text = re.sub(r"\bego\b", "vehicle 1", _OTHER.sub("vehicle 2", text))
    text = _OF_MAP.sub(lambda match: f"the {_MAP_SIDES[match[1]]}", text)
    text = _BOTH_BOUND.sub(_rewrite_both_vehicles, text)
    text = _VERSUS.sub(_rewrite_vehicle, text)
    text = _OPENS.sub(lambda m: f"{m[1]}a {m[2]} vehicle {_MOVES[m[3]]}", text)
    text = _THAT_LEG.sub(_rewrite_leg, text)
    text = _ENTRY_CROSSWALK.sub("the entrywalk", text)
    return _rewrite_backgrounds(_EXIT_CROSSWALK.sub("the exitwalk", text))


def find_denied(text: str) -> frozenset[str]:
    """What clean text says there is none of: event, vehicle, pedestrian."""
    found = {"event"} if _NOTHING_IN_WHICH.search(text) else set()
    for match in _NONE_AT_ALL.finditer(text):
        found.add("pedestrian" if re.fullmatch(_WALKERS, match[1]) else "vehicle")
    return frozenset(found)


def _rewrite_vehicle(match: re.Match[str]) -> str:
    """ "NB left vs SB thru": two vehicles."""
    bound, move = (group for group in match.groups() if group is not None)
    return f"a {bound} vehicle {_MOVES[move]}"


def _rewrite_both_vehicles(match: re.Match[str]) -> str:
    """ "EB and WB left turns": two vehicles."""
    move = _MOVES[match[3]]
    return f"a {match[1]} vehicle {move} and a {match[2]} vehicle {move}"


def _rewrite_leg(match: re.Match[str]) -> str:
    """ "that leg" is the side that was named last."""
    sides = _NAMED_SIDE.findall(match.string[: match.start()])
    return f"the {sides[-1]} crosswalk" if sides else "the exitwalk"


def _rewrite_backgrounds(text: str) -> str:
    text = _BACKGROUND_LIST.sub(lambda match: _COUNT.sub(r"\1 background \2", match[1]), text)
    text = _LABELLED_COUNT.sub(
        lambda match: f"{'no' if match[2] == 'none' else match[2]} background {match[1]}", text
    )
    return _SHARED_BACKGROUND.sub(r"\1\2 \3 background \4", text)
