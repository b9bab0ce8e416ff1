"""Turns of phrase that mean words the lexicon knows, for any agents."""

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


def _rewrite_way(match: re.Match[str]) -> str:
    """ "N-S" between words that name a vehicle."""
    first, second = (letter for letter in match.groups() if letter is not None)
    return f"{_SIDES[first]} to {_SIDES[second]}"


def _rewrite_entry(match: re.Match[str]) -> str:
    """ "car (N, left)"."""
    return f"{match[1]} (from the {_SIDES.get(match[2], match[2])}"


_OVER = (
    r"(?:over |across |onto |into )*(?:the )?(?:cent(?:re|er)[- ]?line|middle line|"
    r"double yellow(?: lines?)?|wrong side(?: of the road)?|oncoming lane|opposite lane)"
)
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
        # The narrator is no road user.
        (
            r"(^\W*|[.;] )(?:the |a |one )?(?:callers?|officers?|police|witness(?:es)?|bystanders?|"
            r"onlookers?|"
            r"reporters?|dash ?cam|camera|footage|cctv)(?: [a-z]+)? (?:observed?|observes|reports?|"
            r"reported|states?|stated|saw|sees|notes?|noted|witnessed|shows?|captures?|captured)"
            r"(?: that)?\b(?! (?:by|him|her|it)\b)",
            r"\1",
        ),
        (
            r",? (?:later |since |subsequently |then )?(?:identified|described|known|named) as "
            r"[^,.;]{1,40}?(?=[,.;]| who | in | on | at )",
            "",
        ),
        (r"\binsured (?=vehicle|car|truck|van|bus|lorry|motorcycle)", ""),
        (
            r"^\W*(?:please )?(?:show|teach|demonstrate to) (?:my |the |our |your )?(?:[a-z]+ )?"
            r"(?:this|the following)\s*:",
            "",
        ),
        (
            r"\b(?:i|we) (?:was|were) (?:just )?(?:standing|waiting|sitting|walking|"
            r"having)[^.,;]{0,40}? "
            r"(?:when|and) (?:i|we) (?:saw|noticed|watched)\b",
            "",
        ),
        (r"(^\W*|[.;] )what (?:i|we) (?:saw|remember|noticed) (?:was|is)(?: that)?\b", r"\1"),
        (r"\b(?:zero|no|0|without(?: any)?) npcs?\b", "no other traffic"),
        (r"\bnpc (?=[a-z])", ""),
        # Parts of a vehicle mean the vehicle.
        (
            r"(?<!on )(?<!from )(?<! to )\bmy (?:own )?(?:(?:rear|front|back|left|right|near "
            r"?side|off ?side|"
            r"driver|passenger) )*(?:bumper|trunk|boot|door|fender|side|tail|wing|mirror|rear|"
            r"back|front|"
            r"hood|bonnet|wheel|quarter panel)(?: end| bumper| door)?\b",
            "my car",
        ),
        (
            r"\bbetween (?:two |the |some |a row of )?parked (?:cars|vans|vehicles|trucks|lorries|"
            r"buses)\b",
            "between parked cars",
        ),
        (
            r"\b(?:unable to|could not|can not|not able to|was too late to|had no time to) "
            r"(?:stop|brake|react)\b(?=\s*(?:[.,;!]|$))",
            "could not stop in time",
        ),
        (
            r"\bone\b([^.;]*?)([,;]| and| n) other(?: one| 1)? (?=(?:is|was|from|coming|comes|"
            r"going|goes|"
            r"turn\w*|head\w*|driv\w*|walk\w*|cross\w*|(?:north|south|east|west)(?:bound)?|"
            r"[nsew]b)\b)",
            r"one\1\2 the other ",
        ),
        (
            r"\bsame (?:approach|leg|entry|side) \((?:from )?(north|south|east|west|[nsew])\)",
            lambda m: f"both from the {_SIDES.get(m[1], m[1])}",
        ),
        (
            r"\bwith (?:just |only |barely |scarcely )?(?:a|an|half a|one|two|\d+) (?:yard|foot|"
            r"feet|inch|"
            r"inche|met(?:re|er)|hand|hair|step|pace)s?(?: or (?:two|so))? to spare\b",
            "with inches to spare",
        ),
        # There is no agent of that kind.
        (
            r"\b(?:cyclist|bicycle|bike|scooter|tram|train|animal|dog|car|vehicle|pedestrian|"
            r"people|"
            r"truck|bus)s?[- ]free\b",
            "",
        ),
        # Off the crosswalks.
        (
            r"\b(?:nowhere near|not (?:even )?(?:at|on|in|using|over)|outside(?: of)?|away from|"
            r"far from) (?:the |a |an |any )?(?:marked |proper |pedestrian |zebra |legal )*"
            r"(?:crossing|crosswalk|zebra)s?\b",
            "outside the crosswalk",
        ),
        (
            r"\bwhere (?:no ?(?:one|body)|people|pedestrians|you|one) (?:should|ought to|may|must|"
            r"can|"
            r"is allowed to|is meant to|are meant to|are allowed to)(?: not| never)? (?:cross|"
            r"walk)\b"
            r"|\bwhere crossing is (?:not allowed|forbidden|prohibited)"
            r"|\bwhere there (?:are|is|were|was) no (?:road )?(?:markings?|stripes|zebra|paint)",
            "outside the crosswalk",
        ),
        (
            r"\bbetween (?:the )?(?:two )?(?:intersections|junctions|crossings|crossroads|corners|"
            r"crosswalks)\b"
            r"|\b(?:half[- ]?way|mid ?way|part ?way|half) (?:down|along|up) (?:the|a) block\b",
            "mid block",
        ),
        # The agent that goes first.
        (
            r"\b(?:all (?:of )?(?:the )?others?|every(?:one|body) else|the rest(?: of the "
            r"traffic)?|"
            r"all (?:the )?other (?:cars|vehicles|traffic|drivers)|all traffic)"
            r"(?= (?:yields?|gives?|waits?|stops?|makes? way|pulls?|lets?|brakes?)\b)",
            "everyone",
        ),
        (
            r"\b(let(?:s|ting)?|allow(?:s|ed|ing)?) ((?:the|an?|it|him|her|them|this|that)"
            r"(?: [a-z]+){0,3}?) (?:to )?(?:roar|rumble|thunder|sweep|rattle|roll|glide|trundle|"
            r"speed|"
            r"rush|slip|sail|whizz|zoom|crawl|squeeze|hurry|trot|rattle|chug|coast) "
            r"(?:by|past|through|along|on|ahead)\b",
            r"\1 \2 pass",
        ),
        (
            r"\b(let(?:s|ting)?|allow(?:s|ed|ing)?) ((?:the|an?|it|him|her|them|this|that)"
            r"(?: [a-z]+){0,3}?) (?:to )?(?:hurry|shuffle|limp|stroll|trot|scurry|hobble|totter|"
            r"amble|"
            r"toddle|scamper) (?:by|past|across|over|on)\b",
            r"\1 \2 cross",
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
        # The agent that is hit, and how close it gets.
        (
            r"\b(?:narrowly |barely |just |only just )?(?:miss|avoid|escap|dodg|evad)(?:es|ed|e|s|"
            r"ing)? (?:being|getting) (?=hit|struck|run|knocked|clipped|mown|crushed|rammed)",
            "is almost ",
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
            r"\bgiv(?:es|ing|e) ((?:[a-z]+ ){1,4}?)a (?:\w+ )?(?:fright|scare|shock|start)\b",
            r"scares \1",
        ),
        (
            r"\bstop(s|ped|ping)? (?:just |only |mere |barely |a few |(?:\d+ ))*(?:inches|inch|cm|"
            r"centimet(?:re|er)s|millimet(?:re|er)s|a hair|a whisker|a foot|half a met(?:re|er)) "
            r"(?:away|short)\b(?! (?:from|of)\b)",
            r"stop\1 just in time",
        ),
        (
            r"\b(?:pass|rush|roar|thunder|whip|sho|fl[ey]|c[ao]m|went|go|sped|speed|tore|"
            r"tear)[a-z]* "
            r"(?:by |past )?so (?:close|near)(?: to (?:him|her|them|it))?\b[^.,;]*",
            "narrowly misses them",
        ),
        (
            r"\b(miss(?:es|ed|ing)?) (?:its|his|her|their) (?:rear |front |back |left |right )?"
            r"(?:bumper|door|wing|fender|mirror|side|tail|bonnet|rear|front|back|skirts?|coat|"
            r"heels?|"
            r"toes?|legs?)\b",
            r"\1 them",
        ),
        (
            r"\bc[oa]m(?:e|es|ing) within (?:a |an |half a |one |two |three |the |\d+ "
            r")?(?:[a-z]+\s+){0,2}?"
            r"(?:breadth|width|inch|inches|foot|feet|yards?|met(?:re|er)s?|hair|whisker|cm|"
            r"centimet(?:re|er)s?) of\b",
            "narrowly misses",
        ),
        (
            r"\bstop(s|ped|ping)? (?:only |just |barely )?(?:a|an|half a|one) (?:foot|inch|hair|"
            r"metre|meter|"
            r"yard|step|pace|whisker|hand) (?:short of|away from|from|before)\b",
            r"stop\1 just short of",
        ),
        (
            r"\b(slam|stand|stood|hit|jam)(s|med|ming|ting)? (?:on )?the anchors\b",
            r"\1\2 the brakes",
        ),
        # Novelists' crashes.
        (r"(?<!right into the )\bflank\b", "side"),
        (
            r"\b(?:bury|buries|buried|burying|plant|plants|planted|ram|rams|rammed) "
            r"(?:its|his|her|their) (?:nose|bonnet|hood|bumper|front|grille|snout) (?:in|into) ",
            "crashes into ",
        ),
        (
            r"\b(?:fold|wrap|hurl|wedge|bur[iy]|slam|fling|flung)[a-z]* (?:itself|himself|herself) "
            r"(?:in|into|round|around|against)\b",
            "crashes into",
        ),
        (
            r"\bm(?:eets?|et) ((?:the|an?) [^.,;]{2,60}?) with (?:a|an) (?:[a-z]+ )?(?:sound|bang|"
            r"crunch|crash|thud|smack|thump)\b",
            r"crashes into \1",
        ),
        (r"\b(?:the )?crush of (?=the|traffic|cars|people)", ""),
        # Over the middle of the road.
        (
            rf"\b(?:cross|drift|veer|swerv|wander|mov|com)[a-z]* {_OVER} into (?=[a-z])",
            "hits head on ",
        ),
        (
            rf"\b(?:cross|drift|stray|veer|swerv|wander)[a-z]* {_OVER}\b(?! (?:of|into)\b)",
            "drives on",
        ),
        (r"\bfront to front\b", "head on"),
        # Following in figures.
        (
            r"\b(?:keep|maintain|hold)[a-z]* (?:an? |its |the )?(?:constant |safe |fixed |steady |"
            r"time )*"
            r"(?:\d[\d.]* ?(?:s|sec|seconds?|m|met(?:re|er)s?)[ -])?"
            r"(?:gap|headway|thw|following distance|time gap|distance)(?: of)?"
            r"(?: \d[\d.]* ?(?:s|sec|seconds?|m|met(?:re|er)s?))? (?:to|behind)\b",
            "follows",
        ),
        (
            r"\b(?:is|was|are|were|stay|sit|keep|hang|remain|stuck|stick)[a-z]* (?:right |hot |"
            r"close |hard )?"
            r"on (?:its|his|her|their) (?:heels|tail|bumper)\b",
            "follows it",
        ),
        (
            r"\b(?:is|was|are|stay|remain|stick)[a-z]* (?:glued|stuck|close|pinned) to (?=(?:the|"
            r"its|a|an) "
            rf"(?:rear |back |tail |bumper |[a-z]+ )?(?:of (?:the|a) )?{_VEHICLE})",
            "follows ",
        ),
        (rf"\bfollower (?={_VEHICLE}\b)", "following "),
        (r"\bbehind of\b", "behind"),
        (r"\ball two\b", "both"),
        (
            r"\b(are|were) all (?=[a-z]+ing\b|(?:north|south|east|west)bound\b|[nsew]b\b|from\b|"
            r"going\b|coming\b|straight\b)",
            r"\1 ",
        ),
        (
            r"\bfrom (?:the )?(left|right)(?: hand)?(?: side)? of (?:it|him|her|them)\b",
            r"from its \1",
        ),
        (
            r"\b(?:left turn across path|ltap)[ ,/]*(?:\(?(?:opposite|lateral) directions?\)?|"
            r"[ol]d)?"
            r"\s*[.:;] (?=[a-z].*\bleft\b)",
            "",
        ),
        # Straight on into another agent's back is no way through the junction.
        (
            r"\b(go(?:es|ing)?|went|r[ua]ns?|running|driv\w+|drove|slam\w*|crash\w*|plo\w+) "
            r"(?:straight|right|directly|smack|bang|squarely|head first) "
            r"(?=into the (?:back|rear|side|front|tail|flank)\b)",
            r"\1 ",
        ),
        (r"\b(?:is|was) (?:right |directly |just |close(?:ly)? )?behind\b", "follows"),
        (r"\b(?:right|directly|immediately|closely) behind (?=(?:an?|the|another)\b)", "behind "),
        # The agent that does not give way.
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
        (
            rf"(^\W*|[:.;,] |\band |\bthen )({BOUND}) (?=(?:cross|hit|strike|yield|give|wait|stop|"
            rf"brake|"
            r"rear end|run|turn|make|fail|follow|drift|collide|sideswipe|clip|cut|let|slow|enter|"
            r"goe)"
            r"(?:es|s)\b|(?:ran|hit|struck|gave|made|let|must|nearly|almost|crossed|yielded|"
            r"failed)\b)",
            r"\1\2 vehicle ",
        ),
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
            rf"\b({BOUND} (?:left|right|thru|through|straight))\s*/\s*"
            rf"(?=(?:{BOUND}|an?|the|ped|peds|pedestrians?|{_VEHICLE})\b)",
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
            r"\b(follows?|yields?(?: to)?|collides?|collision|near miss|hits?)"
            r"\(\s*([^(),]{2,60}),\s*([^(),]{2,60})\)",
            lambda m: f"{m[2]} {_DEEDS[m[1][:3]]} {m[3]}",
        ),
        (r"\b([nsew])[- ]bound\b", lambda m: f"{_SIDES[m[1]]}bound"),
        (r"\b(\d{1,2}|noon|midday|midnight)[- ]?ish\b", r"\1"),
        (
            r"(^\W*|[.;]\s*)(?:first(?:ly)?|second(?:ly)?|third(?:ly)?|next|then|finally|"
            r"lastly),\s",
            r"\1",
        ),
        (
            r"\b(?:fill|populate|stock|dress) the (?:background|rest(?: of the scene)?) with"
            r" (?=\d|[a-z]+ (?:vehicles|cars|pedestrians))",
            "background: ",
        ),
        # All agents at once.
        (
            rf"\b(?:one|an?|1) ({_VEHICLE}) (?:from|on|at) each (?:of the four )?"
            r"(?:direction|side|approach|leg|arm)s?\b",
            r"a \1 from the north, a \1 from the east, a \1 from the south and a \1 from the west",
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
            _rewrite_entry,
        ),
        (
            rf"\b([nsew])-([nsew])(?= (?:\w+ )?{_VEHICLE}\b)|(?<=[a-z\d] )([nsew])-([nsew])\b",
            _rewrite_way,
        ),
    )
)


_YOU = re.compile(
    r"^\W*pov\b|(?<!can )(?<!could )(?<!would )(?<!do )(?<!if )(?<!are )(?<!will )\byou (?:are |"
    r"were )?"
    r"(?:come|came|com(?:ing)|driv\w+|drove|want to|turn\w*|wait\w*|approach\w*|head\w*|cross\w*|"
    r"stop\w*|"
    r"yield\w*|brak\w+|follow\w*|hit\b|go straight)"
)


def rewrite_idioms(text: str) -> str:
    """Clean text with idioms in words that the lexicon knows."""
    if _YOU.search(text):
        text = re.sub(r"\byou(?: (?:are|were)\b)?(?=\s+[a-z]+ing\b)", "i was", text)
        text = re.sub(r"(?<=let )you\b|(?<=lets )you\b|(?<=hits )you\b|(?<=by )you\b", "me", text)
        text = re.sub(r"\byour\b", "my", re.sub(r"\byou\b", "i", text))
    for pattern, new in _PLAIN:
        text = pattern.sub(new, text)
    return text
