"""The page of all fields of a plan file is what the JSON Schema says.

`python tests/docs/test_plan_fields.py` writes it anew.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scenewright.scene.measures import UNITS
from scenewright.scene.plan_file import build_plan_schema

PAGE = Path(__file__).parents[2] / "docs" / "plan-fields.md"
HEAD = """\
# Fields of a plan file

All that a [plan file](plan-files.md) may have, as its JSON Schema (`scenewright plan --schema`)
says. Numbers without a unit are in the one named here. A field with * is needed; one that is left
out is left free. Of a list, or a range of numbers, in place of a value a
[sweep](plan-files.md#ranges-distributions-lists) takes one for each of its points.
"""
SECTIONS = {
    "agents": "AgentNode", "relations": "RelationEdge", "ties": "EntryTie",
    "measures": "Measure", "objects": "ObjectNode", "objects: others": "Meeting",
    "context": "SceneContext", "context: background": "Background", "said": "SaidSpan",
}  # fmt: skip


def write_page() -> str:
    schema = build_plan_schema()
    parts = [HEAD, *write_table("The file", schema)]
    for title, name in SECTIONS.items():
        parts += write_table(f"`{title}`", schema["$defs"][name])
    parts.append("\n## Kinds of measures\n")
    parts.append("| kind | unit | agents | tolerance of one number | least | most |")
    parts.append("|---|---|---|---|---|---|")
    for kind, each in UNITS.items():
        of = "agent, other" if each.of_two else "agent"
        numbers = " | ".join(f"{own:g}" for own in (each.tolerance, each.least, each.most))
        parts.append(f"| `{kind}` | {each.unit} | {of} | {numbers} |")
    return "\n".join(parts) + "\n"


def write_table(title: str, model: dict[str, Any]) -> Iterator[str]:
    yield f"\n## {title}\n"
    yield "| field | what | unit | values |"
    yield "|---|---|---|---|"
    for name, own in model["properties"].items():
        star = "*" if name in model.get("required", ()) else ""
        about = own.get("description", "").replace("|", "\\|")
        values = "; ".join(list_values(own))
        yield f"| `{name}`{star} | {about} | {own.get('unit', '')} | {values} |"


def list_values(own: dict[str, Any]) -> Iterator[str]:
    """What a property may be, without the forms that leave it open."""
    for each in (own, *own.get("anyOf", ())):
        if each is not own and "anyOf" in each:
            yield from list_values(each)
        if "enum" in each or "const" in each:
            yield ", ".join(f"`{value}`" for value in each.get("enum", [each.get("const")]))
        if "$ref" in each:
            yield "a section of its own"
        words = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to"}
        if ends := [f"{word} {each[key]:g}" for key, word in words.items() if key in each]:
            yield " ".join(ends)
        if "pattern" in each and each["pattern"].startswith("^has"):
            yield "`has` and what the leg has"
        elif each.get("pattern", "").startswith("^("):
            yield "an id, such as `vehicle-1`" if "vehicle" in each["pattern"] else "a time"
        elif each.get("pattern", "").startswith("^object"):
            yield "an id, such as `object-1`"
        if each.get("type") == "boolean":
            yield "`true`, `false`"
        if "maxItems" in each:
            yield f"at most {each['maxItems']} entries"


def test_the_page_has_every_field_as_the_schema_says() -> None:
    assert PAGE.read_text("utf-8") == write_page(), "python tests/docs/test_plan_fields.py"


def test_every_section_of_the_schema_has_its_table() -> None:
    schema = build_plan_schema()
    assert set(SECTIONS.values()) == schema["$defs"].keys()
    page = PAGE.read_text("utf-8")
    for model in (schema, *schema["$defs"].values()):
        for name in model["properties"]:
            assert re.search(rf"^\| `{name}`", page, re.MULTILINE), name
    assert "| `target_pet` | post-encroachment time | s | from 0 to 8 |" in page
    assert "| `pet` | s | agent, other | 0.15 | 0 | 8 |" in page


if __name__ == "__main__":
    PAGE.write_text(write_page(), "utf-8")
