"""Words around a request are talk; words that nothing shows are not."""

from __future__ import annotations

import pytest

from scenewright.tools.account.talk import is_talk
from scenewright.tools.account.vocabulary import read_tokens


@pytest.mark.parametrize(
    ("text", "word", "talk"),
    [
        ("The treasurer confirmed that a car hit a bus.", "treasurer", True),
        ("I wrote to you: a car yields to a pedestrian.", "wrote", True),
        ("On Friday Kowalczyk saw a car hit a bus", "kowalczyk", True),
        ("A car follows a bus at a zyzzyva", "zyzzyva", False),
        ("A motorcycle hits a taxi on the fifth lane", "fifth", False),
        ("A van carrying a sofa hits a bus.", "sofa", False),
    ],
)
def test_talk_is_told_from_what_a_scene_would_show(text: str, word: str, talk: bool) -> None:
    tokens = read_tokens(text)
    at = next(n for n, each in enumerate(tokens) if each.text == word)
    assert is_talk(tokens, at) is talk
