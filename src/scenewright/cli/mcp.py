"""`scenewright mcp`: scenes made, changed and checked over the Model Context Protocol.

Two kinds of tools. `make_scene`, `edit_scene`, `undo`, `show_scene`, `explain_refusal`,
`verify_scene`, `scene_json` and those about versions and threads work on a conversation, as
`scenewright chat` does; pictures, pages and files of its versions are resources. `start_scene`
and the tools of `nodes/toolbox.py` make one step by step.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from scenewright.cli.sessions import list_versions, open_session
from scenewright.cli.views import ViewKind, render_view
from scenewright.errors import InputError, Unsatisfiable, describe_misfit
from scenewright.extras import require_extra
from scenewright.nodes.toolbox import ToolState
from scenewright.time_limit import TimeLimitReachedError, limit_time

if TYPE_CHECKING:
    from mcp.server import MCPServer

    from scenewright.authoring.session import Session, SessionVersion
    from scenewright.cli.options import SessionOptions

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
    for tool in (
        desk.make_scene, desk.make_planned_scene, desk.edit_scene, desk.edit_by_hand,
        desk.undo, desk.redo, desk.branch,
        desk.show_scene, desk.list_versions, desk.list_threads, desk.open_thread,
        desk.explain_refusal, desk.verify_scene, desk.scene_json, desk.save_scene,
        desk.start_scene, *desk.list_steps(),
        desk.measure_coverage, desk.read_catalogue, desk.find_scenarios,
    ):  # fmt: skip
        server.add_tool(tool, structured_output=True)
    for uri, read, kind in (
        ("scene://version/{version}/picture.png", desk.read_picture, "image/png"),
        ("scene://version/{version}/page.html", desk.read_page, "text/html"),
        ("scene://version/{version}/scene.json", desk.read_scene, "application/json"),
        ("scene://version/{version}/proof.json", desk.read_proof, "application/json"),
    ):
        server.resource(uri, mime_type=kind)(read)
    return server


_STEPS = (
    "ground_plan", "draw_candidates", "check_program", "solve", "edit_segments", "refine",
    "check_scene", "record_scene",
)  # fmt: skip
Tool = TypeVar("Tool", bound=Callable[..., dict[str, Any]])


def _build_refusal(code: str, detail: str) -> dict[str, Any]:
    return {"ok": False, "code": code, "detail": detail}


def _refuse_unusable(tool: Tool) -> Tool:
    """The tool, which answers an InputError with a refusal."""

    @wraps(tool)
    def run(*values: Any, **named: Any) -> dict[str, Any]:
        try:
            return tool(*values, **named)
        except InputError as error:
            return _build_refusal("unusable_input", str(error))

    return cast(Tool, run)


class _ClientState:
    """The conversation and the tool state of one client."""

    def __init__(self, options: SessionOptions, *, thread: str, out: str | None) -> None:
        self._options, self._out, self._backend = options, out, options.model.load()
        self._bench: ToolState | None = None
        self._threads, self._session = open_session(options, thread, self._backend)

    def make_scene(self, instruction: str) -> dict[str, Any]:
        """A new scene from an instruction, such as "A car yields to a pedestrian at 8 am"."""
        return self._act("make", instruction)

    @_refuse_unusable
    def make_planned_scene(self, plan: dict[str, Any], seed: int | None = None) -> dict[str, Any]:
        """A new scene of the conversation from a plan, without words.

        `plan` has the fields of a plan file (docs/plan-files.md), such as {"agents": [{"id":
        "vehicle-1"}, {"id": "pedestrian-1"}], "relations": [{"type": "yield_to", "from":
        "vehicle-1", "to": "pedestrian-1"}]}.
        """
        from scenewright.scene.plan_file import read_plan

        return self._act("make_plan", read_plan(plan), seed=seed)

    @_refuse_unusable
    def measure_coverage(self, goals: dict[str, Any] | None = None) -> dict[str, Any]:
        """What the scenes kept so far cover, and what of `goals`, such as {"dimensions": [{"cover":
        "event", "values": ["near_miss"], "least": 3}], "crosses": [{"cross": ["event", "hour"]}]}.
        """
        from scenewright.cli.coverage import read_encounters, to_json
        from scenewright.dataset.tables.coverage import measure_coverage, read_goals

        scenes, encounters = read_encounters([self._out or "nowhere"])
        covered = measure_coverage(encounters, None if goals is None else read_goals(goals))
        return {"ok": True, "scenes": scenes, "items": list(map(to_json, covered))}

    @_refuse_unusable
    def find_scenarios(
        self,
        query: str | dict[str, Any],
        paths: list[str],
        intersection: str | None = None,
        limit: int = 20,
        lenient: bool = False,
    ) -> dict[str, Any]:
        """Looks for what words, or the fields of a plan, ask for in recorded tracks.

        `paths` are files, folders or patterns that `verify` reads; `intersection` is the map of the
        tracks, in their frame; `lenient` counts hits of which something cannot be tested.
        """
        from scenewright.cli.find import search

        if limit < 1:
            raise InputError("limit is a whole number above 0")
        try:
            with limit_time(self._options.time_limit):
                found = search(query, paths, intersection, limit=limit, lenient=lenient)
        except TimeLimitReachedError as error:
            return _build_refusal("time_limit", str(error))
        except Unsatisfiable as error:
            return _build_refusal("unsatisfiable", str(error))
        return {**found.to_json(), "notes": found.notes}

    def read_catalogue(self, plan: str = "") -> dict[str, Any]:
        """The plans of consumer tests and regulations with their sources; or one, to be swept."""
        from scenewright.cli.catalogue import format_entry, read_catalogue

        sources = read_catalogue()[1]
        return {"ok": True} | (
            {"plan": format_entry(plan)} if plan in sources["plans"] else sources
        )

    def edit_scene(self, words: str) -> dict[str, Any]:
        """Changes the scene as the words say, such as "now have it be a collision"."""
        return self._act("say", words)

    @_refuse_unusable
    def edit_by_hand(self, edits: list[dict[str, Any]]) -> dict[str, Any]:
        """Typed changes, such as {"edit": "move_stop", "agent": "vehicle-1", "metres": -1.5}.

        The others are come_later and wait_longer (seconds), set_pace (factor) and choose_way
        (entry, exit, movement, crosswalk).
        """
        return self._act("edit", edits)

    def branch(self, name: str) -> dict[str, Any]:
        """A branch from the current version; or over to the one of that name."""
        return self._act("branch", name)

    def list_versions(self) -> dict[str, Any]:
        """All versions with their words; scene://version/N/picture.png shows one."""
        return {"ok": True, **list_versions(self._session)}

    def list_threads(self) -> dict[str, Any]:
        """The names of all conversations, last used first, and which one is open."""
        names = list(self._threads.list_names())
        return {"ok": True, "threads": names, "open": self._session.thread}

    @_refuse_unusable
    def open_thread(self, thread: str) -> dict[str, Any]:
        """Goes over to a conversation; one that is not there begins empty."""
        with self._take_turn() as session:
            if thread != session.thread:
                before = self._threads
                self._threads, self._session = open_session(self._options, thread, self._backend)
                before.close()
            return {"ok": True, "thread": thread, "current": self._session.state.get("current")}

    def read_picture(self, version: str) -> bytes:
        """The picture of a version, a number or `current`."""
        return self._view(version, "png")

    def read_page(self, version: str) -> str:
        """The self-contained page of a version."""
        return self._view(version, "html").decode()

    def read_scene(self, version: str) -> str:
        """scene.json of a version."""
        return self._find(version).scene_json.decode()

    def read_proof(self, version: str) -> str:
        """proof.json of a version."""
        return self._find(version).proof_json.decode()

    def _view(self, version: str, kind: ViewKind) -> bytes:
        shown = self._find(version)
        return render_view(kind, shown.record, shown.proof)

    def _find(self, version: str) -> SessionVersion:
        shown = self._session.find_version(None if version == "current" else version)
        if shown is None:
            raise InputError("there is no scene yet; call make_scene first")
        return shown

    def undo(self) -> dict[str, Any]:
        """Back to the version before."""
        return self._act("undo")

    def redo(self) -> dict[str, Any]:
        """Forth to the version that was undone."""
        return self._act("redo")

    def show_scene(self) -> dict[str, Any]:
        """The current version: its agents, its events, its verdict and account of words."""
        return self._reply({"kind": "shown"})

    def explain_refusal(self) -> dict[str, Any]:
        """Why the last words were refused, and what may help."""
        from scenewright.authoring.explain import explain_refusal

        refused = self._session.state.get("refused")
        return {"ok": True, "lines": [] if refused is None else explain_refusal(refused)}

    @_refuse_unusable
    def verify_scene(self, scene: dict[str, Any] | None = None) -> dict[str, Any]:
        """Checks the current version, or the content of a scene.json that is handed over."""
        from pydantic import ValidationError

        from scenewright.graph.run import verify
        from scenewright.scene.record import SceneRecord

        try:
            shown = self._find("current").record if scene is None else scene
            proof = verify(SceneRecord.model_validate(shown))
        except ValidationError as error:
            raise InputError(f"this is no scene: {describe_misfit(error)}") from error
        return {"ok": True, "verdict": proof.verdict, "caveat": proof.caveat,
                **proof.model_dump(mode="json", by_alias=True)}  # fmt: skip

    @_refuse_unusable
    def scene_json(self) -> dict[str, Any]:
        """The current version as in scene.json: tracks every 0.1 s, annotations, signals."""
        return {"ok": True, "scene": self._find("current").record.to_json()}

    @_refuse_unusable
    def save_scene(self) -> dict[str, Any]:
        """Writes the current version to a folder under the one that the server was started with."""
        from scenewright.cli.views import save_version

        shown = self._find("current")
        if self._out is None:
            raise InputError("the server was started without --out, so nothing is kept")
        name = f"{self._session.thread}-{shown.version['number']}"
        folder, files, _ = save_version(shown, str(Path(self._out) / name))
        return {"ok": True, "folder": str(folder), "files": files}

    def start_scene(self, instruction: str, seed: int = 0) -> dict[str, Any]:
        """Starts an empty scene that is made step by step; next: ground_plan."""
        from scenewright.authoring.agent import build_tool_state

        if not 0 <= seed < 2**63:
            return _build_refusal("unusable_input", "a seed is a whole number from 0 to 2^63 - 1")
        intersection_map = self._options.intersection
        self._bench = build_tool_state(
            instruction, intersection=intersection_map, seed=seed, record=self._keep
        )
        return {"ok": True, "next": "ground_plan"}

    def list_steps(self) -> Iterator[Any]:
        """The tools that make a scene step by step, each as `ToolState` has it."""
        for name in _STEPS:
            method = getattr(ToolState, name)
            signature = inspect.signature(method, eval_str=True)
            own = [each for each in signature.parameters.values() if each.name != "self"]

            @wraps(method)
            def run(name: str = name, **arguments: Any) -> dict[str, Any]:
                return self._step(name, **arguments)

            run.__signature__ = signature.replace(parameters=own)  # type: ignore[attr-defined]
            yield run

    def _step(self, name: str, **arguments: Any) -> dict[str, Any]:
        from scenewright.errors import Rejected

        if self._bench is None:
            return _build_refusal("unusable_input", "no scene was started; call start_scene first")
        try:
            with self._take_turn(), limit_time(self._options.time_limit):
                return {"ok": True, **getattr(self._bench, name)(**arguments)}
        except TimeLimitReachedError as error:
            return _build_refusal("time_limit", str(error))
        except Rejected as error:
            fields = error.rejection.model_dump(mode="json", include={"code", "agents", "detail"})
            return {"ok": False, **fields}

    def _keep(self, record: Any, proof: Any) -> str:
        """A scene of the tool state, under the server's folder."""
        from scenewright.files import write_atomically
        from scenewright.graph.run import encode_proof, encode_scene, make_folder

        if self._out is None:
            return "nowhere: the server was started without --out"
        folder = make_folder(Path(self._out) / record.meta.scene_id)
        write_atomically(folder / "proof.json", encode_proof(proof))
        write_atomically(folder / "scene.json", encode_scene(record))
        return str(folder)

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
        from scenewright.cli.chat import build_facts

        shown = self._session.find_version()
        if reply["kind"] == "refused":
            return {"ok": False, **reply}
        if shown is None:
            return _build_refusal("unusable_input", reply.get("reason", "there is no scene yet"))
        return {"ok": True, **reply, "version": shown.version["number"], **build_facts(shown)}
