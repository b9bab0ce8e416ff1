"""The sentences that a refusal offers: few, short, and of what the text speaks of."""

from __future__ import annotations

import re

from scenewright.backends.builtin.planner import LONGEST_OFFER, MOST_OFFERS, plan
from scenewright.evals.planning import load
from scenewright.scene.social import Refusal

ROWS = load("voices")[::3]


def test_offers_are_few_and_short_and_keep_what_happens() -> None:
    made = []
    for row in ROWS:
        found = plan(row["text"], previous=row.get("previous"))
        if not isinstance(found, Refusal):
            continue
        made += found.did_you_mean
        crashes = any(each["type"] == "collision" for each in row["expected"]["relations"])
        assert len(found.did_you_mean) <= MOST_OFFERS == 3
        for offer in found.did_you_mean:
            assert len(offer.split()) < LONGEST_OFFER == 25, offer
            assert not (crashes and "Nothing happens" in offer), row["text"]
            assert "U-turn" not in offer or re.search("turn|round", row["text"], re.I), row["text"]
    assert len(made) > 20
