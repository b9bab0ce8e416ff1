"""Words that are true of the place or of every scene, whatever is planned (SEMANTICS 9)."""

from __future__ import annotations

import re

_PLACE = r"(?: (?:road|street))? (?:intersection|junction|crossroads)"
_SPEED = r"\d+ ?(?:mph|km/?h|kph)"
_FACTS = (
    rf"(?:signal[ -]?controlled|signali[sz]ed|four[ -](?:way|leg(?:ged)?)|urban|city){_PLACE}",
    r"(?:urban|built[ -]up|residential|metropolitan) (?:area|environment|setting|zone|district)",
    r"(?:clear|dry|fine|good|normal|no adverse) (?:weather|skies|visibility)(?: conditions)?",
    r"(?:dry|paved|level|asphalt) (?:road|pavement|roadway|surface|road surface)(?: conditions)?",
    r"(?:clear|dry|daylight|daytime) conditions",
    r"(?:broad )?daylight(?: hours)?|daytime",
    rf"(?:posted )?speed limit (?:is |was |of |: ?)*{_SPEED}",
    rf"{_SPEED} (?:speed )?(?:limit|zone)",
    r"no (?:injuries|injury|fatalities)(?: (?:were )?reported)?|nobody (?:is|was) (?:hurt|injured)",
    r"(?:clear|dry)(?= *(?:,|and|;|$))",
)
_LEADS = r"(?:\b(?:in|at|on|with|under|during|and|having|there (?:is|are))\s+)?(?:an?\s+|the\s+)?"
_STANDING = re.compile(
    rf"{_LEADS}\b(?:{'|'.join(_FACTS)})\b(?:\s*,)?(?:\s+and(?=\s+(?:in|at|on|with)))?",
    re.IGNORECASE,
)


def blank_standing_facts(text: str) -> str:
    """The text with blanks in place of what stands anyway, so that all else keeps its place.

    >>> blank_standing_facts("In daylight, a car turns").strip()
    'a car turns'
    """
    blanked = _STANDING.sub(lambda match: " " * len(match[0]), text)
    return blanked if re.search(r"\w", blanked) else text
