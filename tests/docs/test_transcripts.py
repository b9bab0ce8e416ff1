"""Conversations that the pages show are what a reader gets who types the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from transcripts import PAGES, Talk, said, shown

TALKS = [talk for page in PAGES for talk in shown(page)]


def test_no_conversation_is_missed() -> None:
    blocks = sum(len(re.findall(r"^```text\n\S+> ", p.read_text("utf-8"), re.M)) for p in PAGES)
    assert blocks == len(TALKS) >= 2


@pytest.mark.parametrize("talk", TALKS, ids=lambda talk: talk.page.name)
def test_a_shown_conversation_is_true(talk: Talk, tmp_path: Path) -> None:
    told = [line for lines in talk.told for line in lines]
    found = said(talk.command, talk.typed, tmp_path)
    assert found[: len(told)] == told, "meant? then run: python tests/docs/transcripts.py"
