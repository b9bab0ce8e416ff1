"""Requests: each option is declared once, and read by the command line, the tools and the page.

They are dataclasses, which pydantic reads where a tool or the page needs it: `--help` is to be
there before pydantic is loaded.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeVar,
    get_args,
    get_type_hints,
)

import typer

from scenewright.cli.console import Result, show_progress, show_result
from scenewright.cli.output_folder import try_folder
from scenewright.errors import InputError
from scenewright.intersections import SHIPPED
from scenewright.time_limit import DEFAULT_LIMIT

if TYPE_CHECKING:
    from scenewright.backends import Backend

CommandT = TypeVar("CommandT", bound=Callable[..., Any])


def option(default: Any, help: str, *names: str, check: Any = None, **more: Any) -> Any:
    """An option of a command; without names it has that of its parameter.

    Args:
        default: `...` where it must be given.
        check: called with its value before the command is, which it returns.
        more: as `typer.Option` has it, such as `metavar` and `min`.
    """
    return _describe(default, typer.Option(*names, help=help, callback=check, **more))


def argument(default: Any, help: str, *, check: Any = None, **more: Any) -> Any:
    """An argument of a command, as `option` is."""
    return _describe(default, typer.Argument(help=help, callback=check, **more))


def _describe(default: Any, info: Any) -> Any:
    told = {"description": info.help, "ge": info.min, "le": info.max}  # as pydantic reads them
    metadata = {key: each for key, each in told.items() if each is not None}
    return field(default=MISSING if default is ... else default, metadata=metadata | {"info": info})


Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no summary.")]


@dataclass(frozen=True)
class Asked:
    """A request; pydantic refuses what is no field, or of another type."""

    __pydantic_config__: ClassVar[Any] = {"extra": "forbid", "strict": True}

    def pass_on(self, to: Callable[..., Any]) -> dict[str, Any]:
        """The options that a function takes, by name; those of requests within it as well."""
        taken, found = inspect.signature(to).parameters, dict[str, Any]()
        for name, each in vars(self).items():
            if isinstance(each, Asked):
                found |= each.pass_on(to)
            elif name in taken:
                found[name] = each
        return found

    def list_words(self) -> list[str]:
        """The words of a command line that ask for the same: options that are not the default."""
        words: list[str] = []
        for each in fields(self):
            value, name = getattr(self, each.name), f"--{each.name.replace('_', '-')}"
            if isinstance(value, Asked):
                words += value.list_words()
            elif value is True and each.default is not True:
                words.append(name)
            elif value != each.default:
                given = value if isinstance(value, list) else [value]
                words += [word for item in given for word in (name, str(item))]
        return words


@dataclass(frozen=True)
class BoardOptions:
    """Which leaderboard is entered, and under what name."""

    board: str | None = option(None, "Leaderboard to enter; a page is beside it.", metavar="F.json")
    name: str | None = option(None, "Of the submission, on the board.")

    def __post_init__(self) -> None:
        if (self.board is None) != (self.name is None):
            raise InputError("--board and --name go together: which page, and under what name")

    def enter(self, figures: Mapping[str, Any], **more: Any) -> list[str]:
        """Enters figures where a board is named; what is said of it (see `enter_leaderboard`)."""
        if self.board is None:
            return []
        from scenewright.evals.leaderboard import enter_leaderboard

        page = enter_leaderboard(Path(self.board), str(self.name), figures, **more)
        return [f"written: {self.board}, {page}"]


class Commands(typer.Typer):
    """A group of commands, whose parameters may be dataclasses: each field is then an option.

    A command that returns a `Result` has --json, one that takes a `log` has --quiet.
    """

    def command(self, name: str | None = None, **more: Any) -> Callable[[CommandT], CommandT]:
        """Adds a function as a command, and returns it as it is."""

        def add(command: CommandT) -> CommandT:
            own = list(list_parameters(command, _describe_to_typer))
            logs = "log" in inspect.signature(command).parameters
            answer = _get_hints(command).get("return")
            shows = Result in (answer, *get_args(answer))
            for each, hint, is_asked in (("quiet", Quiet, logs), ("as_json", Json, shows)):
                if is_asked and each not in [parameter.name for parameter in own]:
                    kind = inspect.Parameter.KEYWORD_ONLY
                    own.append(inspect.Parameter(each, kind, default=False, annotation=hint))

            def run(**values: Any) -> None:
                quiet = values.get("quiet", False)
                if logs:
                    with show_progress(quiet=quiet) as log:
                        result = command(**collect(command, values | {"log": log}))
                else:
                    result = command(**collect(command, values))
                if result is not None:
                    show_result(result, quiet=quiet, as_json=values["as_json"])
                    if result.code:
                        raise typer.Exit(result.code)

            run.__doc__, run.__name__, run.__annotations__ = command.__doc__, command.__name__, {}
            run.__signature__ = inspect.Signature(own)  # type: ignore[attr-defined]
            super(Commands, self).command(name, **more)(run)
            return command

        return add


@cache  # the same options stand in several commands
def _get_hints(made: Callable[..., Any]) -> dict[str, Any]:
    return get_type_hints(made, include_extras=True)


def list_parameters(
    made: Callable[..., Any], describe: Callable[[Any, Mapping[str, Any]], Any]
) -> Iterator[inspect.Parameter]:
    """Those of a command or a tool, and in place of a dataclass those of its fields.

    Args:
        describe: the annotation of a type and of what `option` noted of it.
    """
    hints, noted = _get_hints(made), getattr(made, "__dataclass_fields__", {})
    for name, each in inspect.signature(made).parameters.items():
        found, hint, default = noted.get(name, each.default), hints[name], each.default
        if isinstance(found, Field) and "info" in found.metadata:
            hint = describe(hint, {**found.metadata, "name": name})
            default = each.empty if found.default is MISSING else found.default
        if is_dataclass(hint):
            yield from list_parameters(hint, describe)  # type: ignore[arg-type]
        elif name != "log":  # the program's own
            yield each.replace(kind=each.KEYWORD_ONLY, annotation=hint, default=default)


def _describe_to_typer(hint: Any, noted: Mapping[str, Any]) -> Any:
    info = noted["info"]
    if hint is bool and not info.param_decls and info.default is ...:
        info.param_decls = (f"--{noted['name'].replace('_', '-')}",)  # and no --no-NAME
    return Annotated[hint, info]


def collect(made: Callable[..., Any], values: dict[str, Any]) -> dict[str, Any]:
    """The arguments of a command or a dataclass from the values of all options."""
    hints = _get_hints(made)
    return {
        name: hints[name](**collect(hints[name], values)) if is_dataclass(hints[name])
        else values[name]
        for name in inspect.signature(made).parameters
    }  # fmt: skip


MaxAgents = Annotated[
    int | None,
    typer.Option(
        "--max-agents",
        metavar="N",
        envvar="SCENEWRIGHT_MAX_AGENTS",
        help="Most agents that a scene may hold; without it as many as the time of day has.",
    ),
]
UNASKED = "Refuse scenes in which an agent runs a red light that no word asks for."


@dataclass(frozen=True)
class PlaceOptions(Asked):
    """Where scenes happen, and how long one may take."""

    intersection: str = option(SHIPPED, "Where it happens.")
    time_limit: float = option(
        DEFAULT_LIMIT,
        "Emergency brake: longest that a scene may be computed [s], answers of models aside. "
        "Counted work ends long before, and alone decides what is made.",
        metavar="S",
    )


@dataclass(frozen=True)
class LawOptions(PlaceOptions):
    """The same, and whether a red light may be run."""

    lawful: bool = option(False, UNASKED)


@dataclass(frozen=True)
class EndpointOptions:
    """Where a model is asked, and how long it may take."""

    base_url: str | None = option(
        None,
        "OpenAI-compatible endpoint that serves the model, such as http://localhost:8000/v1.",
        metavar="URL",
    )
    timeout: float | None = option(None, "Longest wait for one reply of a model [s].", metavar="S")


@dataclass(frozen=True)
class ModelOptions(EndpointOptions):
    """Who plans and reasons, and how models are asked."""

    backend: list[str] | None = option(
        None,
        "Planner and reasoner: builtin (the default), anthropic:MODEL, openai:MODEL or "
        "recorded:FILE; or STAGE=NAME, repeated, with planner, filter or reasoner.",
        metavar="NAME",
    )
    record: str | None = option(
        None, "Keep every answer there; what it holds is not asked again.", metavar="FILE"
    )

    def load(self) -> Backend:
        """The backend that the options name.

        Raises:
            InputError: there is none such; says which option to mend.
        """
        from scenewright.backends import load_backend

        named = self.backend or ["builtin"]
        return load_backend(
            named[0] if len(named) == 1 else named,
            base_url=self.base_url, record=self.record, timeout=self.timeout,
        )  # fmt: skip


@dataclass(frozen=True)
class DrawOptions(Asked):
    """How a scene of words is drawn."""

    selection: Literal["draw", "map"] = option(
        "draw", "Draw among the combinations that fit, or take the likeliest."
    )
    lenient: bool = option(False, "Leave out words that cannot be realised, and list them.")
    max_agents: MaxAgents = None


@dataclass(frozen=True)
class SessionOptions(LawOptions):
    """What conversations of `chat`, `mcp` and `serve` begin with, and where they are kept."""

    intersection: str = option(SHIPPED, "Where new conversations happen.")
    model: ModelOptions = ModelOptions()
    seed: int = option(0, "Of everything drawn, in a new conversation.")
    threads: str | None = option(None, "Where conversations are kept.", metavar="FILE")


@dataclass(frozen=True)
class ImportOptions(Asked):
    """Which junction of a map file is imported, and how."""

    name: str = option(..., "What to call it; commands take the short form that is shown.")
    center: str | None = option(
        None,
        "Where the junction is; X,Y if the file has no degrees.",
        "--at",
        "--center",
        metavar="LAT,LON",
    )
    street: list[str] | None = option(
        None, "A street of the junction; give two to choose one.", metavar="NAME"
    )
    junction: str | None = option(None, "Which junction, by its id in the file.", metavar="ID")
    left_hand: bool | None = option(
        None, "Which side is driven on, if not as said.", "--left-hand/--right-hand"
    )
    signals: Literal["keep", "assume", "none"] = option(
        "keep", "Signals: the file's, an assumed programme if it has none, or none."
    )
    extent: float | None = option(None, "Half the side of the square that is mapped [m].")
    title: str | None = option(None, "Its title; else its streets' names.")
    licence: str | None = option(None, "Licence of the map, to be kept with the bundle.")
    force: bool = option(False, "Replace one of that name.")


@dataclass(frozen=True)
class FitOptions:
    """How recorded tracks are read, and what is fitted on them."""

    columns: str | None = option(
        None, "A csv's columns: t=frame/25,id=track,class==car,x=px,y=py.", metavar="MAP"
    )
    origin: str | None = option(None, "Where x = y = 0 of the tracks lies.", metavar="LAT,LON")
    shift: str | None = option(None, "Added to the positions instead [m].", metavar="X,Y")
    start: str | None = option(None, "Time of day, where the files state none.", metavar="HH:MM")
    counts: str | None = option(
        None, "Counts: columns hour, vehicles[, pedestrians].", metavar="CSV"
    )
    licence: str | None = option(None, "Licence of the tracks.")
    named: str | None = option(
        None,
        "The data set they are of: sind, ind, interaction, dut, argoverse1, argoverse2...",
        "--format",
        metavar="NAME",
    )
    scale: float | None = option(None, "Metres per pixel of tracks in pixels.", metavar="M")
    pool: list[str] | None = option(
        None, "Vehicles at a place without a map, for the pool.", metavar="TRACKS"
    )
    pool_scale: float | None = option(None, "Metres per pixel of those.", metavar="M")
    train: bool = option(False, "Adapt the refiner to the tracks, if that is better.")
    lights: str | None = option(
        None, "Recorded lights: SPaT, or columns light, t, colour.", metavar="CSV"
    )
    light_legs: str | None = option(None, "Leg of each light: 1=east,13=walk_east.", metavar="MAP")


@dataclass(frozen=True)
class TrainOptions:
    """What a refiner is trained on, and how long."""

    corpus: str = option(..., "Recorded hours, of `simulate --corpus`.", metavar="F")
    out: str | None = option(
        None, "Folder to write; one's own intersection, else intersections/NAME.", check=try_folder
    )
    epochs: int | None = option(None, "How often all is seen.", min=1)
    walkers: list[str] | None = option(
        None,
        "Tracks of real people on foot, to learn walking from; may be given again.",
        metavar="PATH",
    )
    others: list[str] | None = option(
        None,
        "Tracks of another intersection, of `simulate --corpus`; may be given again.",
        metavar="F",
    )
    walking: float | None = option(
        None, "Share of what is learned that changes how people walk.", min=0.0, max=1.0
    )
    go_on: bool = option(False, "From the weights that serve the intersection on.")
    most: int | None = option(None, "Stretches of the corpus that are learned from.", min=1)
    seed: int = option(0, "Seed of the training.", min=0)


@dataclass(frozen=True)
class ChatOptions(SessionOptions):
    """What `chat` is asked for."""

    thread: str | None = option(None, "Thread to go on with; a new one if none is named.")
    refiner: str | None = option(None, "trajnet or none, in a new thread; that of make.")
    out: str | None = option(None, "Folder that /save writes to.", check=try_folder)
    no_memory: bool = option(False, "Recall nothing, remember nothing.")
