"""Closed lists of words that rules read better than a network: vehicles and times of day."""

from __future__ import annotations

import re

from scenewright.scene.base import AgentClass
from scenewright.scene.kinds import list_shipped

_SUBTYPES = (
    ("motorcycle", r"\bpolice (?:motor ?-?(?:cycle|bike)|bike)"),
    ("ambulance", r"\b(?:ambulances?|paramedics?|rescue vehicle)\b"),
    (
        "fire_engine",
        r"\bfire[- ]?(?:engine|truck|appliance|tender)s?\b|\bladder truck\b|\bpumper\b",
    ),
    (
        "police_car",
        r"\b(?:police|patrol|squad|cop|sheriff(?:'s)?) ?(?:cars?|cruisers?|vehicles?|units?)\b|"
        r"\bcruisers?\b|\bpanda car\b|^(?:the |a )?police$",
    ),
    (
        "emergency",
        r"\b(?:emergency|blue[- ]light) (?:vehicle|car|van|truck|service)s?\b|"
        r"\bpolice (?:van|truck)s?\b",
    ),
    ("taxi", r"\b(?:taxis?|(?:mini|taxi)?cabs?|cabbies?|hackney)\b"),
    ("van", r"(?<!camper )(?<!mini)\bvans?\b|\bsprinter\b|\bford transit\b|\bminibus"),
    (
        "bus",
        r"\b(?:mini|school |city |tour )?bus(?:es)?\b|\bcoach(?:es)?\b|double-?decker|\bomnibus",
    ),
    (
        "motorcycle",
        r"motor ?-?(?:cycle|bike)|\bmoped|\bvespa|\bbiker|\bmotorcyclist|\bharley|"
        r"\bmo-?ped|\bmoto\b|\bdirt bike|\bscooter|\bkawasaki|\bducati|\byamaha|\bsuperbike|"
        r"\bchopper\b|"
        r"\btwo-?wheelers?\b|\bmotor(?:ised|ized)? ?bike",
    ),
    (
        "truck",
        r"\b(?:truck|lorr(?:y|ies)|hgv|semi|tractor[- ]trailer|eighteen|18-?wheeler|"
        r"tanker|dump|flatbed|artic|juggernaut|big rig|rig|tipper|gritter|"
        r"street sweeper|mixer|dustcart|bin wagon|trucker)(?:s|es)?\b",
    ),
    (
        "car",
        r"\b(?:cars?|vans?|suvs?|sedans?|hatchbacks?|minivans?|pick-?ups?|estate|opel|skoda|seat|"
        r"renault|peugeot|citro[eë]n|vauxhall|mazda|subaru|hyundai|suzuki|saab|lada|dacia|porsche|"
        r"jaguar|buick|chevy|chevrolet|dodge|chrysler|lexus|mini|corsa|astra|polo|fiesta|clio|civic|"
        r"corolla|camry|passat|transporter|motorcar|automobile|ev|banger|"
        r"saloon|coupe|convertible|jeep|limo(?:usine)?|auto|police|patrol|uber|"
        r"toyota|ford|honda|bmw|audi|tesla|volvo|kia|nissan|mercedes|vw|golf|prius|fiat|"
        r"crossover|wagon|roadster|hearse|camper)\b",
    ),
)
_COMPILED = tuple((name, re.compile(pattern, re.IGNORECASE)) for name, pattern in _SUBTYPES)
_PICKUP = re.compile(r"\bpick-?up(?: truck)?s?\b", re.IGNORECASE)
_TIMES = (
    ("dawn", r"\bdawn|sunrise|daybreak|sun-?up|first light|cock-?crow"),
    ("early morning", r"early (?:in the )?morning|early am\b|first thing|morning,? early|crack of"),
    (
        "morning rush",
        r"(?:morning|am|a\.m\.)[- ](?:rush|peak|commut)|(?:rush|peak)[^,;]*morning|morning traffic|"
        r"school run|rush hour am",
    ),
    ("mid-morning", r"mid-?morning|late morning"),
    (
        "evening rush",
        r"(?:evening|afternoon|pm|p\.m\.)[- ](?:rush|peak|commut)|(?:rush|peak)[^,;]*"
        r"(?:evening|afternoon)|after-?work",
    ),
    ("rush hour", r"\b(?:rush|peak)[- ]?(?:hour|time|traffic|period)|\brush\b|commut"),
    ("early afternoon", r"early (?:in the )?afternoon"),
    ("mid-afternoon", r"mid-?afternoon"),
    ("late afternoon", r"late (?:in the )?afternoon"),
    ("afternoon", r"\bafternoon|\barvo\b"),
    ("lunch", r"\blunch"),
    ("midnight", r"\bmidnight|witching hour"),
    ("noon", r"\bnoon|mid-?day|high noon"),
    ("dusk", r"\bdusk|sunset|sundown|twilight|nightfall|gloaming|getting dark"),
    ("early evening", r"early (?:in the )?evening"),
    ("late evening", r"late (?:in the )?evening"),
    ("evening", r"\bevening"),
    ("late night", r"\blate\b[^,;]*night|dead of (?:the )?night|late at night|after dark"),
    ("small hours", r"small hours|wee hours"),
    ("night", r"\b(?:to)?night|nocturnal|\bdark(?:ness)?\b"),
    ("morning", r"\bmorning|\bforenoon"),
)


def find_subtype(words: str) -> str | None:
    """The subtype of vehicle that some words name; None where they leave it open."""
    if _PICKUP.search(words):
        return "car"
    return next((name for name, pattern in _COMPILED if pattern.search(words)), None)


def find_class(words: str) -> AgentClass | None:
    """The class of road user that some words name; None where they leave it open."""
    if _RIDER.search(words):
        return "cyclist"
    if re.search(r"\be-?scooter|\bkick scooter", words, re.IGNORECASE):
        return "scooter"
    if find_subtype(words) is not None:
        return "vehicle"
    return "pedestrian" if _WALKER.search(words) else None


_RIDER = re.compile(
    r"\b(?:cyclist|bicycle|bicyclist|push-?bike|(?:cargo|road|mountain) bike|(?<!motor)(?<!motor )"
    r"(?<!dirt )bike)s?\b",
    re.IGNORECASE,
)
_WALKER = re.compile(
    r"\b(?:ped(?:estrian)?|walker|jogger|runner|(?:wo)?man|child|kid|girl|boy|lady|person|"
    r"grandmother|grandfather|nurse|student|tourist)s?\b",
    re.IGNORECASE,
)


COARSE = {kind.id: kind.wider for kind in list_shipped("subtype") if kind.wider}
"""Subtypes as kinds of a wider one."""


def narrow_subtype(subtype: str | None, head: str) -> str | None:
    """The subtype that a noun says where only the wider one is known."""
    found = find_subtype(head)
    return found if subtype in (None, "car", "truck") and found in COARSE else subtype


def time_words_in(low: str) -> list[str]:
    """Names of times of day (as in `clock`) in lower-case words, the most specific first."""
    found: list[str] = []
    for name, pattern in _TIMES:
        if re.search(pattern, low):
            found.append(name)
            low = re.sub(pattern, " ", low)
    return found


_USER = re.compile(
    r"\b(?:vehicles?|autos?|ego|ped(?:estrian)?s?|(?:wo)?m[ae]n|girls?|boys?|kids?|child(?:ren)?|"
    r"lad(?:y|ies)|walkers?|joggers?|persons?|people|bikes?|motors?)\b",
    re.IGNORECASE,
)


def has_user_noun(words: str) -> bool:
    """Whether some words name a road user by a noun."""
    return find_subtype(words) is not None or _USER.search(words) is not None
