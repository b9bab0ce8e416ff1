"""`scenewright mcp`: scenes made, changed and checked over the Model Context Protocol.

Two kinds of tools. `make_scene`, `edit_scene`, `undo`, `show_scene`, `explain_refusal`,
`verify_scene`, `scene_json` and those about versions and threads work on a conversation, as
`scenewright chat` does; pictures, pages and files of its versions are resources. `start_scene`
and the tools of `nodes/toolbox.py` make one step by step.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, ValidationError

from scenewright.authoring.agent import build_tool_state
from scenewright.authoring.explain import explain_refusal
from scenewright.authoring.session import Session, SessionVersion
from scenewright.cli.catalogue import format_entry, read_catalogue
from scenewright.cli.coverage import read_encounters, to_json
from scenewright.cli.find import Search, search
from scenewright.cli.options import SessionOptions, collect, list_parameters, option
from scenewright.cli.saved import SAVED, write_saved
from scenewright.cli.sessions import build_facts, list_versions, open_session
from scenewright.cli.views import save_scene, save_version
from scenewright.dataset.tables.coverage import measure_coverage, read_goals
from scenewright.errors import InputError, Rejected, Unsatisfiable, describe_misfit
from scenewright.extras import require_extra
from scenewright.graph.arguments import check_arguments
from scenewright.graph.scene_files import encode_proof, encode_scene
from scenewright.graph.verify import verify
from scenewright.nodes.toolbox import ToolState
from scenewright.scene.plan_file import read_plan
from scenewright.scene.record import SceneRecord
from scenewright.time_limit import TimeLimitReachedError, limit_time

if TYPE_CHECKING:
    from mcp.server import MCPServer

_GUIDE = """\
Makes verified traffic scenes at one intersection. make_scene takes an instruction in plain
language, edit_scene what shall be different, in words; everything that need not change stays as it
was. A refusal has "ok": false and a reason; mend exactly that. To go step by step instead:
start_scene, ground_plan, draw_candidates, solve, edit_segments, refine, check_scene, record_scene.
"""


def build_server(options: SessionOptions, *, thread: str, out: str | None) -> MCPServer[Any]:
    """The server with its tools, not yet running.

    Args:
        thread: that the tools work on at first; out: folder that scenes are kept in; None: nowhere.

    Raises:
        InputError: the package `mcp` is not installed, or the thread cannot be used.
    """
    require_extra("mcp", "serving tools", "mcp")
    from mcp.server import MCPServer

    server: MCPServer[Any] = MCPServer("scenewright", instructions=_GUIDE, log_level="WARNING")
    desk = _ClientState(options, thread=thread, out=out)
    tools: list[Callable[..., dict[str, Any]]] = [
        desk.make_scene, desk.make_planned_scene, desk.edit_scene, desk.edit_by_hand,
        desk.undo, desk.redo, desk.branch,
        desk.show_scene, desk.list_versions, desk.list_threads, desk.open_thread,
        desk.explain_refusal, desk.verify_scene, desk.scene_json, desk.save_scene,
        desk.start_scene, *desk.list_steps(),
        desk.measure_coverage, desk.read_catalogue, desk.find_scenarios,
    ]  # fmt: skip
    for tool in tools:
        server.add_tool(_answer_refusals(tool), structured_output=True)
    for name, (file, about) in _RESOURCES.items():
        uri, kind = f"scene://version/{{version}}/{name}", SAVED[file]
        server.resource(uri, mime_type=kind, description=about)(desk.build_resource(file))
    return server


_RESOURCES = {
    "picture.png": ("scene.png", "The picture of a version, a number or `current`."),
    "page.html": ("page.html", "The self-contained page of a version."),
    "scene.json": ("scene.json", "scene.json of a version."),
    "proof.json": ("proof.json", "proof.json of a version."),
}
"""Name of a resource -> the file that it is, and what it is."""
_STEPS = (
    "ground_plan", "draw_candidates", "check_program", "solve", "edit_segments", "refine",
    "check_scene", "record_scene",
)  # fmt: skip


def _answer_refusals(tool: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
    """The tool as it is served: its requests as their fields, a refusal as an answer."""

    @wraps(tool)
    def run(**values: Any) -> dict[str, Any]:
        try:
            return {"ok": True, **tool(**collect(tool, values))}
        except Rejected as error:
            fields = error.rejection.model_dump(mode="json", include={"code", "agents", "detail"})
            return {"ok": False, **fields}
        except TimeLimitReachedError as error:
            return {"ok": False, "code": "time_limit", "detail": str(error)}
        except (InputError, Unsatisfiable) as error:
            return {"ok": False, "code": error.code, "detail": str(error)}

    own = list(list_parameters(tool, _describe_to_pydantic))
    run.__signature__ = inspect.signature(tool, eval_str=True).replace(parameters=own)  # type: ignore[attr-defined]
    return run


def _describe_to_pydantic(hint: Any, noted: Mapping[str, Any]) -> Any:
    told = {key: noted[key] for key in ("description", "ge", "le") if key in noted}
    return Annotated[hint, Field(**told)]


@dataclass(frozen=True)
class _ToolSearch(Search):
    """The same for agents, who read every hit."""

    limit: int = option(20, "Most hits.", min=1)


class _ClientState:
    """The conversation and the tool state of one client."""

    def __init__(self, options: SessionOptions, *, thread: str, out: str | None) -> None:
        self._options, self._out, self._backend = options, out, options.model.load()
        self._bench: ToolState | None = None
        self._threads, self._session = open_session(options, thread, self._backend)

    def make_scene(self, instruction: str) -> dict[str, Any]:
        """A new scene from an instruction, such as "A car yields to a pedestrian at 8 am"."""
        return self._act("make", instruction)

    def make_planned_scene(self, plan: dict[str, Any], seed: int | None = None) -> dict[str, Any]:
        """A new scene of the conversation from a plan, without words.

        `plan` has the fields of a plan file (docs/plan-files.md), such as {"agents": [{"id":
        "vehicle-1"}, {"id": "pedestrian-1"}], "relations": [{"type": "yield_to", "from":
        "vehicle-1", "to": "pedestrian-1"}]}.
        """
        return self._act("make_plan", read_plan(plan), seed=seed)

    def measure_coverage(self, goals: dict[str, Any] | None = None) -> dict[str, Any]:
        """What the scenes kept so far cover, and what of `goals`, such as {"dimensions": [{"cover":
        "event", "values": ["near_miss"], "least": 3}], "crosses": [{"cross": ["event", "hour"]}]}.
        """
        scenes, encounters = read_encounters([self._out or "nowhere"])
        covered = measure_coverage(encounters, None if goals is None else read_goals(goals))
        return {"scenes": scenes, "items": list(map(to_json, covered))}

    def find_scenarios(self, query: str | dict[str, Any], asked: _ToolSearch) -> dict[str, Any]:
        """Looks for what words, or the fields of a plan, ask for in recorded tracks.

        `paths` are files, folders or patterns that `verify` reads; `intersection` is the map of the
        tracks, in their frame; `lenient` counts hits of which something cannot be tested.
        """
        with limit_time(self._options.time_limit):
            found = search(query, asked)
        return {**found.to_json(), "notes": found.notes}

    def read_catalogue(self, plan: str = "") -> dict[str, Any]:
        """The plans of consumer tests and regulations with their sources; or one, to be swept."""
        sources = read_catalogue()[1]
        return {"plan": format_entry(plan)} if plan in sources["plans"] else sources

    def edit_scene(self, words: str) -> dict[str, Any]:
        """Changes the scene as the words say, such as "now have it be a collision"."""
        return self._act("say", words)

    def edit_by_hand(self, edits: list[dict[str, Any]]) -> dict[str, Any]:
        """Typed changes, such as {"edit": "move_stop", "agent": "vehicle-1", "metres": -1.5}.

        The others are come_later and wait_longer (seconds), set_pace (factor) and choose_way
        (entry, exit, movement, crosswalk).
        """
        return self._act("edit", edits)

    def branch(self, name: str) -> dict[str, Any]:
        """A branch from the current version; or over to the one of that name."""
        return self._act("branch", name)

    def undo(self) -> dict[str, Any]:
        """Back to the version before."""
        return self._act("undo")

    def redo(self) -> dict[str, Any]:
        """Forth to the version that was undone."""
        return self._act("redo")

    def show_scene(self) -> dict[str, Any]:
        """The current version: its agents, its events, its verdict and account of words."""
        return self._reply({"kind": "shown"})

    def list_versions(self) -> dict[str, Any]:
        """All versions with their words; scene://version/N/picture.png shows one."""
        return list_versions(self._session)

    def list_threads(self) -> dict[str, Any]:
        """The names of all conversations, last used first, and which one is open."""
        return {"threads": list(self._threads.list_names()), "open": self._session.thread}

    def open_thread(self, thread: str) -> dict[str, Any]:
        """Goes over to a conversation; one that is not there begins empty."""
        with self._take_turn() as session:
            if thread != session.thread:
                before = self._threads
                self._threads, self._session = open_session(self._options, thread, self._backend)
                before.close()
            return {"thread": thread, "current": self._session.state.get("current")}

    def explain_refusal(self) -> dict[str, Any]:
        """Why the last words were refused, and what may help."""
        refused = self._session.state.get("refused")
        return {"lines": [] if refused is None else explain_refusal(refused)}

    def verify_scene(self, scene: dict[str, Any] | None = None) -> dict[str, Any]:
        """Checks the current version, or the content of a scene.json that is handed over."""
        try:
            shown = self._find("current").record if scene is None else scene
            proof = verify(SceneRecord.model_validate(shown))
        except ValidationError as error:
            raise InputError(f"this is no scene: {describe_misfit(error)}") from error
        return {"verdict": proof.verdict, "caveat": proof.caveat,
                **proof.model_dump(mode="json", by_alias=True)}  # fmt: skip

    def scene_json(self) -> dict[str, Any]:
        """The current version as in scene.json: tracks every 0.1 s, annotations, signals."""
        return {"scene": self._find("current").record.to_json()}

    def save_scene(self) -> dict[str, Any]:
        """Writes the current version to a folder under the one that the server was started with."""
        shown = self._find("current")
        if self._out is None:
            raise InputError("the server was started without --out, so nothing is kept")
        name = f"{self._session.thread}-{shown.version['number']}"
        folder, files, _ = save_version(shown, str(Path(self._out) / name))
        return {"folder": str(folder), "files": files}

    def start_scene(self, instruction: str, seed: int = 0) -> dict[str, Any]:
        """Starts an empty scene that is made step by step; next: ground_plan."""
        check_arguments(seed, "none")
        place = self._options.intersection
        self._bench = build_tool_state(
            instruction, intersection=place, seed=seed, record=self._keep
        )
        return {"next": "ground_plan"}

    def list_steps(self) -> Iterator[Callable[..., dict[str, Any]]]:
        """The tools that make a scene step by step, each as `ToolState` has it."""
        for name in _STEPS:
            method = getattr(ToolState, name)
            signature = inspect.signature(method, eval_str=True)
            own = [
                parameter for parameter in signature.parameters.values() if parameter.name != "self"
            ]

            @wraps(method)
            def run(name: str = name, **arguments: Any) -> dict[str, Any]:
                if self._bench is None:
                    raise InputError("no scene was started; call start_scene first")
                with self._take_turn(), limit_time(self._options.time_limit):
                    return dict(getattr(self._bench, name)(**arguments))

            run.__signature__ = signature.replace(parameters=own)  # type: ignore[attr-defined]
            yield run

    def build_resource(self, file: str) -> Callable[[str], str | bytes]:
        """What reads a file of a version, in `SAVED`."""

        def read(version: str) -> str | bytes:
            data = write_saved(self._find(version), file)
            return data if SAVED[file].startswith("image/") else data.decode()

        return read

    def _find(self, version: str) -> SessionVersion:
        shown = self._session.find_version(None if version == "current" else version)
        if shown is None:
            raise InputError("there is no scene yet; call make_scene first")
        return shown

    def _keep(self, record: Any, proof: Any) -> str:
        """A scene of the tool state, under the server's folder."""
        if self._out is None:
            return "nowhere: the server was started without --out"
        files = {"proof.json": encode_proof(proof), "scene.json": encode_scene(record)}
        return str(save_scene(Path(self._out) / record.meta.scene_id, files, {})[0])

    @contextmanager
    def _take_turn(self) -> Iterator[Session]:
        """One call at a time, on the conversation that is open when its turn has come."""
        while True:
            session = self._session
            with session.take_turn():
                if session is self._session:
                    yield session
                    return

    def _act(self, act: str, *argument: Any, **named: Any) -> dict[str, Any]:
        """One turn of the conversation, and the scene as it left it."""
        with self._take_turn() as session:
            return self._reply(getattr(session, act)(*argument, **named))

    def _reply(self, reply: dict[str, Any]) -> dict[str, Any]:
        shown = self._session.find_version()
        if reply["kind"] == "refused":
            return {"ok": False, **reply}
        if shown is None:
            raise InputError(reply.get("reason", "there is no scene yet"))
        return {**reply, "version": shown.version["number"], **build_facts(shown)}
