"""`scenewright chat`: a scene made and changed in conversation."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from scenewright.authoring.explain import explain_refusal
from scenewright.authoring.session import MAIN, SessionVersion, list_branches
from scenewright.cli.console import (
    ProgressCallback,
    format_one_line,
    is_terminal,
    log_line,
    paint,
    show_progress,
    write_json,
    write_stdout,
)
from scenewright.cli.interrupts import forget_interrupt, has_terminate_signal
from scenewright.cli.options import ChatOptions
from scenewright.cli.sessions import (
    add_facts,
    choose_free_name,
    compare,
    find_memory_file,
    get_version,
    list_threads,
    list_versions,
    open_session,
)
from scenewright.cli.turn_report import format_reply
from scenewright.cli.views import ViewKind, record_version, save_version, write_view
from scenewright.errors import InputError
from scenewright.graph.examples import recall_from
from scenewright.intersections import find_data_folder
from scenewright.memory.episodes import Episodes

HELP = """\
Say what shall happen, then what shall be different: "make the pedestrian come from the east",
"now have it be a collision", "add three cars", "stop one metre later", "slow the car down".

/undo, /redo        back to the version before, and forth again
/branch NAME        a branch from here, or over to the one of that name
/branches           which branches there are
/history            all versions
/show [N]           a version in words: the current one, or number N, or branch N
/compare A B        two versions or branches, agent by agent
/save [DIR]         write the scene to a folder
/html [F]           write a page that plays the scene
/gif [F], /mp4 [F]  write an animation
/play, /open        play it in the browser; open its recording in the viewer
/why                why the last words were refused
/help, /quit"""

_LONGEST_WORDS = 20_000
_LONGEST_HISTORY = 2000


def run_chat(options: ChatOptions, *, quiet: bool = False, as_json: bool = False) -> None:
    """Talks until the input ends.

    Raises:
        InputError: the thread cannot be used.
    """
    loop = _ChatLoop(options, quiet=quiet, as_json=as_json)
    try:
        loop.run()
    finally:
        loop.threads.close()


class _ChatLoop:
    """Reads lines, lets the session act, says what became of it."""

    def __init__(self, options: ChatOptions, *, quiet: bool, as_json: bool) -> None:
        self._episodes = None if options.no_memory else Episodes(find_memory_file())
        self._display: ProgressCallback = lambda _stage, _line: None
        self.threads, self._session = open_session(
            options, options.thread or choose_free_name("thread", list_threads(options.threads)),
            options.model.load(), refiner=options.refiner,
            log=lambda stage, line: self._display(stage, line),  # noqa: PLW0108 -- it changes
            recall=None if self._episodes is None else recall_from(self._episodes),
        )  # fmt: skip
        self._out, self._json = options.out, as_json
        self._quiet = quiet or as_json or not is_terminal(sys.stderr)
        self._commands: dict[str, Callable[[list[str]], dict[str, Any]]] = {
            "undo": lambda _: self._session.undo(),
            "redo": lambda _: self._session.redo(),
            "branch": lambda to: self._session.branch(to[0]) if to else self._list_branches(),
            "branches": lambda _: self._list_branches(),
            "history": lambda _: {"kind": "history", **list_versions(self._session)},
            "show": self._show,
            "compare": self._compare,
            "save": self._save,
            "html": partial(self._save_view, "html"),
            "gif": partial(self._save_view, "gif"),
            "mp4": partial(self._save_view, "mp4"),
            "play": lambda _: self._play(),
            "open": lambda _: self._open(),
            "why": lambda _: self._explain(),
            "help": lambda _: {"kind": "help", "text": HELP},
        }

    def run(self) -> None:
        """Runs until the input ends or the user quits."""
        if not self._json:
            self._greet()
        for line in _lines(f"{self._session.thread}> ", quiet=self._json):
            words = line.strip()
            if not words:
                continue
            if words.lower() in ("/quit", "/exit", "/q"):
                return
            self._say_back(words, self._answer(words))

    def _greet(self) -> None:
        state, cut = self._session.state, self._session.interrupted
        version = state.get("current")
        if version is None:
            log_line(f"thread {self._session.thread}: say what shall happen, or /help")
        else:
            log_line(f"thread {self._session.thread}, at version {version}; /show, /help")
        if cut:
            log_line(
                f"the last turn was cut short and left nothing behind: {format_one_line(cut)!r}"
            )

    def _answer(self, words: str) -> dict[str, Any]:
        try:
            if words.startswith("/"):
                name, *arguments = words[1:].split() or [""]
                if name.lower() not in self._commands:
                    name = format_one_line(name, limit=40)
                    raise InputError(f"there is no /{name}; /help lists all")
                return self._commands[name.lower()](arguments)
            if len(words) > _LONGEST_WORDS:
                raise InputError(f"{len(words)} characters are too many for one turn")
            if any("\ud800" <= char <= "\udfff" for char in words):
                raise InputError("these words are not valid UTF-8 text")
            reply = self._run_turn(words)
            if reply["kind"] != "wish":
                return reply
            if reply["wish"] == "quit":
                reason = "Goodbye; the conversation is kept. /quit ends it."
                return {"kind": "nothing", "reason": reason}
            folder = [str(Path("scenes") / reply["name"])] if "name" in reply else []
            return self._commands[reply["wish"]](folder)
        except InputError as error:
            return {"kind": "refused", "code": error.code, "reason": str(error)}

    def _run_turn(self, words: str) -> dict[str, Any]:
        """One turn; Ctrl-C gives it up and leaves the thread as it was."""
        try:
            with show_progress(quiet=self._quiet) as self._display:
                return self._session.say(words)
        except KeyboardInterrupt:
            if has_terminate_signal():
                raise
            forget_interrupt()
            return {"kind": "nothing", "reason": "given up; the scene is as it was"}
        finally:
            self._display = lambda _stage, _line: None

    def _list_branches(self) -> dict[str, Any]:
        state = self._session.state
        here = state.get("branch", MAIN)
        return {"kind": "branches", "branches": list_branches(state), "branch": here}

    def _show(self, arguments: list[str]) -> dict[str, Any]:
        shown = get_version(self._session, *arguments[:1])
        return {"kind": "shown", "version": shown.version["number"]}

    def _compare(self, arguments: list[str]) -> dict[str, Any]:
        if len(arguments) != 2:
            raise InputError("/compare needs two versions or branches, such as /compare 1 2")
        return compare(*(get_version(self._session, argument) for argument in arguments))

    def _name(self, shown: SessionVersion) -> str:
        return f"{self._session.thread}-{shown.version['number']}"

    def _save(self, arguments: list[str]) -> dict[str, Any]:
        shown = get_version(self._session)
        place = " ".join(arguments) or self._out or str(Path("scenes") / self._name(shown))
        folder, files, warnings = save_version(shown, place)
        warnings += self._remember(shown)
        return {"kind": "saved", "folder": str(folder), "files": files, "warnings": warnings}

    def _save_view(self, kind: ViewKind, arguments: list[str]) -> dict[str, Any]:
        """Writes the current version as one file; a file that is there is not overwritten."""
        shown = get_version(self._session)
        path = Path(" ".join(arguments) or f"{self._name(shown)}.{kind}")
        if path.exists():
            raise InputError(f"{path} is there already; name another file")
        return self._write(kind, path, shown)

    def _write(self, kind: ViewKind, path: Path, shown: SessionVersion) -> dict[str, Any]:
        write_view(kind, path, shown.record, shown.proof)
        return {"kind": "saved", "folder": str(path.parent), "files": [path.name], "warnings": []}

    def _remember(self, shown: SessionVersion) -> list[str]:
        """What went wrong, if it did: the scene is saved in any case."""
        if self._episodes is None:
            return []
        try:
            self._episodes.accept(
                request=shown.version["text"],
                graph=shown.version["graph"],
                taxonomy=shown.provenance.get("taxonomy", []),
            )
        except InputError as error:
            return [f"not remembered: {error}"]
        return []

    def _play(self) -> dict[str, Any]:
        """Opens the current version in the browser; says where its page lies."""
        import webbrowser

        shown = get_version(self._session)
        path = self._view_file(shown, "html")
        reply = self._write("html", path, shown)
        none = [] if webbrowser.open(path.as_uri()) else ["there is no browser to open it in"]
        return {**reply, "warnings": none}

    def _open(self) -> dict[str, Any]:
        """Opens the recording of the current version, until its viewer is closed."""
        from scenewright.viz.recording import open_recording

        shown = get_version(self._session)
        path = self._view_file(shown, "rrd")
        record_version(shown, path)
        open_recording(path)
        return {"kind": "nothing", "reason": f"closed; the recording lies at {path}"}

    def _view_file(self, shown: SessionVersion, ending: str) -> Path:
        folder = find_data_folder() / "views"
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        return folder / f"{self._name(shown)}.{ending}"

    def _explain(self) -> dict[str, Any]:
        refused = self._session.state.get("refused")
        none = ["nothing was refused since the last change"]
        lines = none if refused is None else explain_refusal(refused)
        return {"kind": "why", "lines": lines, "refused": refused}

    def _say_back(self, words: str, reply: dict[str, Any]) -> None:
        reply, shown = add_facts(self._session, reply)
        if self._json:
            ok = reply["kind"] != "refused"
            write_json({"ok": ok, "thread": self._session.thread, "words": words, **reply})
            return
        for style, line in format_reply(reply, shown):
            indent = line[: len(line) - len(line.lstrip(" "))]
            plain = format_one_line(line, limit=_LONGEST_HISTORY)
            write_stdout(paint(indent + plain, style) + "\n")


def _lines(prompt: str, *, quiet: bool) -> Iterator[str]:
    """What is typed, or what a script sends, line by line; Ctrl-D ends it."""
    if sys.stdin is None:
        return
    if quiet or not is_terminal(sys.stdin):
        for raw in sys.stdin.buffer:
            yield raw[: 4 * _LONGEST_WORDS].decode("utf-8", "surrogateescape")
        return
    with _keep_history():
        while True:
            try:
                yield input(prompt)
            except EOFError:
                log_line("")
                return
            except KeyboardInterrupt:
                if has_terminate_signal():
                    raise
                forget_interrupt()
                log_line("\n/quit or Ctrl-D ends the conversation")


@contextmanager
def _keep_history() -> Iterator[None]:
    """Arrow keys bring back what was typed, also in earlier conversations."""
    file = find_data_folder() / "chat_history"
    with suppress(ImportError, OSError):
        import readline

        readline.set_history_length(1000)
        readline.read_history_file(file)
    try:
        yield
    finally:
        with suppress(ImportError, OSError):
            import readline

            file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            readline.write_history_file(file)
            file.chmod(0o600)
