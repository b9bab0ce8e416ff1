"""Which format reads a file."""

from __future__ import annotations

import pytest

from scenewright.errors import InputError
from scenewright.tools.formats.registry import FORMATS, find_reader, read_scenarios


def test_content_tells_a_commonroad_file_from_others_that_end_alike() -> None:
    reader = find_reader("scene.xml", b"<commonRoad version='2020a'>")
    assert reader is FORMATS["commonroad"]
    assert find_reader("scene.xml") is not reader


def test_no_content_makes_a_reader_of_an_unknown_file() -> None:
    assert find_reader("scene.txt", b"<commonRoad>") is None
    with pytest.raises(InputError):
        read_scenarios(b"<commonRoad>", name="scene.txt")
