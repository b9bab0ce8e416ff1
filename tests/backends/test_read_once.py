"""One text, many seeds: it is read once, and anew when the relation files are others."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.scene.social import SocialGraph

PAGE = Path(__file__).parents[2] / "docs" / "relations.md"
EXAMPLE = PAGE.read_text("utf-8").split("```toml\n")[1].split("```")[0]


def test_a_text_read_before_is_read_anew_with_other_relation_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "A car noses out in front of another car"
    before = plan(text)
    (tmp_path / "mine.toml").write_text(EXAMPLE, "utf-8")
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path))
    known = plan(text)
    assert isinstance(known, SocialGraph)
    assert [edge.pattern for edge in known.relations] == ["noses_out"]
    assert plan(text) is known
    monkeypatch.delenv("SCENEWRIGHT_RELATIONS")
    assert plan(text) == before != known
