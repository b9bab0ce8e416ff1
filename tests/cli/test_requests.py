"""A request is declared once: command line, tools and page say the same of its fields."""

from __future__ import annotations

import asyncio
import dataclasses
from pathlib import Path
from typing import Any

import pytest
import typer
from pydantic import TypeAdapter, ValidationError
from starlette.testclient import TestClient

from scenewright.backends import load_backend
from scenewright.cli.batch import RunOptions
from scenewright.cli.find import Search
from scenewright.cli.main import app, main
from scenewright.cli.options import Asked, SessionOptions
from scenewright.cli.page.server import Page, build_app
from scenewright.graph.run import synthesize


def list_helps(*words: str) -> dict[str, str]:
    """Name of each parameter of a command -> its help."""
    command: Any = typer.main.get_command(app)
    for word in words:
        command = command.commands[word]
    return {each.name: each.help for each in command.params}


def list_descriptions(schema: dict[str, Any]) -> dict[str, str]:
    return {name: each.get("description", "") for name, each in schema["properties"].items()}


def test_a_tool_is_described_as_the_command_is(tmp_path: Path) -> None:
    pytest.importorskip("mcp")
    from scenewright.cli.mcp import build_server

    options = SessionOptions(threads=str(tmp_path / "t.sqlite"))
    tools = asyncio.run(build_server(options, thread="t", out=None).list_tools())
    (schema,) = (each.input_schema for each in tools if each.name == "find_scenarios")
    told, helps = list_descriptions(schema), list_helps("find")
    fields = [each.name for each in dataclasses.fields(Search)]
    assert {name: told[name] for name in fields} == {name: helps[name] for name in fields}
    assert schema["properties"]["limit"]["minimum"] == 1


def test_the_page_imports_a_map_by_the_request_of_the_command(tmp_path: Path) -> None:
    options = SessionOptions(threads=str(tmp_path / "t.sqlite"))
    page = Page(options, load_backend("builtin"), tmp_path)
    opened = build_app(page, token="t", hosts=frozenset({"here:1"}))
    with TestClient(opened, base_url="http://here:1", headers={"x-token": "t"}) as client:
        document = client.get("/api/openapi.json").json()
        wrong = client.post("/api/maps/x/import", json={"name": "x", "signals": "all"})
        strange = client.post("/api/maps/x/import", json={"name": "x", "side": "left"})
    page.close()
    body = document["paths"]["/api/maps/{map}/import"]["post"]["requestBody"]["content"]
    told, helps = (
        list_descriptions(body["application/json"]["schema"]),
        list_helps("intersections", "import"),
    )
    assert told == {name: helps[name] for name in told}
    assert (wrong.status_code, wrong.json()["reason"].partition(":")[0]) == (400, "signals")
    assert (strange.status_code, strange.json()["reason"].partition(":")[0]) == (400, "side")


def test_text_is_no_number_in_a_request() -> None:
    read = TypeAdapter(Search).validate_json
    assert read('{"paths": ["a"], "limit": 3}') == Search(paths=["a"], limit=3)
    for wrong in ('{"paths": "a"}', '{"paths": [], "limit": "3"}', '{"paths": [], "limit": 0}'):
        with pytest.raises(ValidationError):
            read(wrong)


def test_what_a_function_takes_is_passed_on_by_name() -> None:
    @dataclasses.dataclass(frozen=True)
    class Inner(Asked):
        lawful: bool = True

    @dataclasses.dataclass(frozen=True)
    class Outer(Asked):
        seed: int = 3
        colour: str = "red"
        inner: Inner = Inner()

    assert Outer().pass_on(synthesize) == {"seed": 3, "lawful": True}


def test_a_request_is_spelt_as_the_words_that_ask_for_it() -> None:
    asked = RunOptions(workers=2, backend=["openai:m", "filter=builtin"], lawful=True, seed=3)
    words = ["--backend", "openai:m", "--backend", "filter=builtin", "--lawful", "--workers", "2"]
    assert asked.list_words() == [*words, "--seed", "3"]
    assert RunOptions().list_words() == []
    command: Any = typer.main.get_command(app).commands["batch"]  # type: ignore[attr-defined]
    given = command.make_context("batch", ["IN", "--out", "o", *asked.list_words()]).params
    assert {key: given[key] for key in vars(asked)} == vars(asked)


def test_scenes_of_a_folder_are_found_by_every_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        synthesize("A car yields to a pedestrian at 5 am", refiner="none").save(f"all/{name}")
    assert main(["verify", "all"]) == 0
    assert main(["export", "all", "--to", "csv", "--out", "csv"]) == 0
    assert main(["show", "all", "--png", "sheet.png"]) == 0
    assert (tmp_path / "sheet.png").is_file()
    capsys.readouterr()
    (tmp_path / "all" / "manifest.json").write_text(
        '{"files": {"b/scene.json": ""}, "rows": {}, "tables": {}}'
    )
    assert main(["verify", "all", "--json"]) == 0
    assert capsys.readouterr().out.count('"path"') == 1
