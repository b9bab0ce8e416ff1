"""What became of a turn, in lines for people; each with its style."""

from __future__ import annotations

from typing import Any

from scenewright.authoring.session import SessionVersion
from scenewright.cli.scene_summary import choose_style, summarize_scene
from scenewright.scene.record import SceneRecord

Line = tuple[str, str]
GOOD, BAD, PLAIN, FAINT, ASK = "green", "red", "", "dim", "yellow"
_MOST_NAMES = 8


def format_reply(reply: dict[str, Any], shown: SessionVersion | None) -> list[Line]:
    """The lines of a reply.

    Args:
        shown: the version that the reply is about, if it is about one.
    """
    match reply["kind"]:
        case "made" | "moved_to":
            return _format_version(reply, shown)
        case "asked":
            return [(ASK, reply["question"])]
        case "refused":
            return [(BAD, f"refused: {reply['reason']}")]
        case "answer" | "why":
            return [(PLAIN, each) for each in reply["lines"]]
        case "nothing":
            return [(FAINT, reply["reason"])]
        case "shown":
            return [*_format_version(reply, shown), *map(_format_agent, reply["agents"])]
        case "compared":
            return _format_comparison(reply)
        case "saved":
            warned = [(ASK, f"warning: {each}") for each in reply["warnings"]]
            return [*warned, (GOOD, f"{reply['folder']}: {', '.join(reply['files'])}")]
        case "history":
            return _format_history(reply) or [(FAINT, "there is no version yet")]
        case "branches":
            marks = {name: "*" if name == reply["branch"] else " " for name in reply["branches"]}
            rows = [f"{marks[n]} {n}: version {v}" for n, v in reply["branches"].items()]
            return [(PLAIN, row) for row in rows] or [(FAINT, "there is no version yet")]
        case "help":
            return [(PLAIN, each) for each in reply["text"].splitlines()]
    return [(PLAIN, str(reply))]


def _format_version(reply: dict[str, Any], shown: SessionVersion | None) -> list[Line]:
    if shown is None:
        return [(PLAIN, f"version {reply['version']}")]
    first, *rest = summarize_scene(shown.record, shown.proof)
    branch = f" on branch {reply['branch']}" if "branch" in reply else ""
    style = choose_style(verified=shown.proof.verified, caveat=shown.proof.caveat)
    lines = [(style, f"version {reply['version']}{branch}: {first}"), *((PLAIN, r) for r in rest)]
    if reply["kind"] == "made" and reply.get("from") is not None and reply["edits"]:
        lines.append((FAINT, f"  {_format_others(reply, shown.record)}"))
    if reply.get("note"):
        lines.append((ASK, f"  note: {reply['note']}"))
    return lines


def _format_others(reply: dict[str, Any], scene: SceneRecord) -> str:
    """Other agents that changed; of a background that was drawn anew how many there are now."""
    around = [agent.name for agent in scene.agents if agent.role == "background"]
    redrawn = bool(reply["gone"]) and {*around} <= {*reply["come"]} and len(around) > 0
    said = []
    for key, verb in (("moved", "also moved"), ("gone", "gone"), ("come", "new")):
        if reply[key] and not (redrawn and key != "moved"):
            said.append(f"{verb}: {_format_names(reply[key])}")
    if redrawn:
        said.append(f"the background is drawn anew: {len(around)} agents, no longer "
                    f"{len(reply['gone'])}")  # fmt: skip
    if reply["let_go"]:
        said.append(f"solved anew, so no longer as given: {_format_names(reply['let_go'])}")
    if reply["longer"]:
        much = abs(reply["longer"])
        said.append(f"the scene lasts {much:g} s {'longer' if reply['longer'] > 0 else 'less'}")
    return "; ".join(said) if said else "all other agents are unchanged"


def _format_names(names: list[str]) -> str:
    shown = ", ".join(names[:_MOST_NAMES])
    more = len(names) - _MOST_NAMES
    return f"{shown} and {more} more" if more > 0 else shown


def _format_agent(agent: dict[str, Any]) -> Line:
    what, role = agent["subtype"] or agent["type"], agent["role"]
    line = f"  {agent['id']:>3} {agent['name']}: {what}, {agent['entry']} to {agent['exit']}"
    return (PLAIN, line) if role == "foreground" else (FAINT, f"{line}, background")


def _format_comparison(reply: dict[str, Any]) -> list[Line]:
    lines = [(GOOD, f"versions {reply['first']} and {reply['second']}")]
    lines += [(PLAIN, f"  {key}: {one} | {other}") for key, one, other in reply["differences"]]
    for key, words in (
        ("same", "the same to the last bit"), ("changed", "in both, but different"),
        ("only_first", f"only in {reply['first']}"), ("only_second", f"only in {reply['second']}"),
    ):  # fmt: skip
        if reply[key]:
            lines.append((FAINT, f"  {words}: {_format_names(reply[key])}"))
    return lines


def _format_history(reply: dict[str, Any]) -> list[Line]:
    lines = []
    for row in reply["versions"]:
        mark = "*" if row["version"] == reply["current"] else " "
        origin = "" if row["from"] is None else f" (from {row['from']})"
        style = GOOD if mark == "*" else PLAIN
        lines.append((style, f"{mark} {row['version']}{origin}: {row['words']}"))
    return lines
