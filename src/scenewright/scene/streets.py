"""Names of streets, however they are written."""

from __future__ import annotations

import re

_LONG = {
    "st": "street", "str": "street", "ave": "avenue", "av": "avenue", "rd": "road", "ln": "lane",
    "blvd": "boulevard", "dr": "drive", "sq": "square", "pl": "place", "hwy": "highway",
    "ct": "court", "ter": "terrace", "cres": "crescent", "pkwy": "parkway", "cir": "circle",
    "gdns": "gardens", "gt": "great", "lwr": "lower", "upr": "upper", "mt": "mount", "ft": "fort",
    "ne": "northeast", "nw": "northwest", "se": "southeast", "sw": "southwest", "br": "bridge",
    "strasse": "straße", "str.": "straße", "first": "1st", "second": "2nd", "third": "3rd",
    "fourth": "4th", "fifth": "5th", "sixth": "6th", "seventh": "7th", "eighth": "8th",
    "ninth": "9th", "tenth": "10th", "eleventh": "11th", "twelfth": "12th",
    "w": "west", "e": "east", "n": "north", "s": "south",
}  # fmt: skip
TYPES = frozenset(
    (
        *("street", "avenue", "road", "lane", "boulevard", "drive", "square", "place", "way"),
        *("highway", "terrace", "court", "crescent", "parkway", "circle", "gardens", "straße"),
    )
)


def expand_name(words: str) -> str:
    """The words of a name in small letters, with abbreviations spelt out.

    >>> expand_name("W 120th St."), expand_name("St. James's Road")
    ('west 120th street', "saint james road")
    """
    plain = re.sub(r"['’]s\b|['’]", "", words.casefold())
    plain = re.sub(r"\b([nsew])\.?\s?([ew])\.?(?=\s)", r"\1\2", plain)
    found = [word for word in re.findall(r"\w+", plain) if word != "the"]
    if len(found) > 1 and found[0] == "st":
        found[0] = "saint"
    return " ".join(_LONG.get(word, word) for word in found)
