"""Words that files use for the classes of road users, and the subtypes that they mean."""

from __future__ import annotations

from functools import lru_cache

_SYNONYMS = {
    "car": "vehicle automobile passenger passenger_car passenger_vehicle van minivan suv taxi "
    "pickup cab agent av others regular_vehicle",
    "truck": "lorry heavy_vehicle truck_bus trailer semi hgv delivery",
    "bus": "coach minibus",
    "motorcycle": "motorbike motorcyclist moped scooter motor tricycle motorcycle_tricycle",
    "bicycle": "bike cyclist bicyclist biker e_scooter escooter electric_scooter kick_scooter",
    "pedestrian": "ped person people walker human pedestrian/bicycle",
}
SUBTYPE_OF_WORD = {
    word: subtype for subtype, words in _SYNONYMS.items() for word in (subtype, *words.split())
}
SUBTYPES = tuple(_SYNONYMS)


@lru_cache(maxsize=256)
def find_subtype(text: str) -> str | None:
    """The subtype that a word such as `Passenger car` means; None where it is unknown."""
    word = "_".join(text.lower().replace("-", " ").replace("_", " ").split())
    return SUBTYPE_OF_WORD.get(word)
