"""`scenewright catalogue`: shipped plans of the tests of consumer programmes and regulations."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Annotated, Any

import typer

from scenewright.cli.batch import Sampling, SweepOptions, sweep
from scenewright.cli.console import Result, format_columns, show_result, write_stdout
from scenewright.cli.options import Commands, Json, Quiet, argument, option
from scenewright.cli.output_folder import try_folder
from scenewright.errors import InputError

catalogue = Commands(name="catalogue", help="Shipped plans of consumer tests and regulations.")
Name = Annotated[str, typer.Argument(metavar="ID", help="As `catalogue list` has it.")]


def read_catalogue() -> tuple[Traversable, dict[str, Any]]:
    """The folder of the plans; and by id what each is taken from, and why others are absent."""
    folder = resources.files("scenewright.scene") / "catalogue"
    sources = tomllib.loads((folder / "sources.toml").read_text("utf-8"))
    for source in sources["plans"].values():
        source["document"] = sources["documents"][source["document"]]
    return folder, sources


def format_entry(name: str) -> str:
    """A plan with what it is taken from as comments.

    Raises:
        InputError: there is no such plan.
    """
    folder, sources = read_catalogue()
    if name not in sources["plans"]:
        raise InputError(f"there is no {name}; `scenewright catalogue list` names what there is")
    about = "".join(f"# {key}: {value}\n" for key, value in sources["plans"][name].items())
    return about + (folder / f"{name}.yaml").read_text("utf-8")


@catalogue.command("list")
def list_entries() -> Result:
    """List the plans, and which tests there is none of, and why."""
    _, sources = read_catalogue()
    rows = [(name, each["title"], each["section"]) for name, each in sources["plans"].items()]
    absent = "".join(f" none of {names}: {why}\n" for names, why in sources["absent"].items())
    table = format_columns(("id", "what happens", "section"), rows, right=set())
    return Result({key: sources[key] for key in ("plans", "absent")}, table + absent)


@catalogue.command("show")
def show_entry(name: Name) -> None:
    """Print a plan, with its source; edit it and give it to `sweep`."""
    write_stdout(format_entry(name))


@dataclass(frozen=True)
class CatalogueOptions(SweepOptions):
    """The same, but the points that the test names."""

    sampling: Sampling = "grid"


@catalogue.command("make")
def make_entries(
    *,
    name: str | None = argument(None, "Which plan.", metavar="ID"),
    every: bool = option(False, "All plans, a folder each.", "--all"),
    out: str = option("catalogue", "Folder to write.", metavar="DIR", check=try_folder),
    options: CatalogueOptions,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make the scenes of a plan as `sweep` does: DIR/ID has the table of points and the scenes."""
    folder, sources = read_catalogue()
    if every == (name is not None):
        raise InputError("name one plan, or write --all")
    for source in sources["plans"] if name is None else [name]:
        format_entry(source)  # it is there
        with resources.as_file(folder / f"{source}.yaml") as file:
            made = sweep(plan=str(file), out=f"{out}/{source}", options=options, quiet=quiet)
        show_result(made, quiet=quiet, as_json=as_json)
