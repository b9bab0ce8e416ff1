"""`scenewright evals satisfaction`: scenes of any program against instructions of other people."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from scenewright.cli.common_options import BoardFile, BoardName, Json, Quiet
from scenewright.cli.console import log_line, show_progress, write_json, write_stdout
from scenewright.cli.interrupts import stop_if_asked
from scenewright.errors import InputError


def score_satisfaction(
    folder: Annotated[
        str | None,
        typer.Argument(metavar="DIR", help="ID/scene.json, or ID.SUFFIX: tracks, for each row."),
    ] = None,
    rows: Annotated[
        str | None,
        typer.Option(metavar="F.jsonl", help="Write the instructions as rows for `batch`."),
    ] = None,
    intersection: Annotated[
        str, typer.Option(help="Map of submitted tracks; a scene.json names its own.")
    ] = "amsterdam_120",
    board: BoardFile = None,
    name: BoardName = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """How many instructions of other people are satisfied by scenes of any program.

    490 labelled instructions by writers who had seen no planner. First `--rows F.jsonl` writes
    them; then DIR is judged from its tracks alone: the events that the checker finds, between
    agents that come from, go to and cross what the label says, and nothing else.
    """
    from scenewright.evals.leaderboard import enter_leaderboard
    from scenewright.evals.planning import load
    from scenewright.evals.satisfaction import judge as judging
    from scenewright.files import write_atomically

    labelled = [row for row in load("voices") if "disputed" not in row]
    if (folder is None) == (rows is None):
        raise InputError("name either a folder to judge, or --rows FILE to write the instructions")
    if (board is None) != (name is None):
        raise InputError("--board and --name go together: which page, and under what name")
    if rows is not None:
        own = ({"id": row["id"], "text": row["text"]} for row in labelled)
        lines = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in own)
        write_atomically(rows, lines.encode("utf-8"))
        write_stdout(f"{rows}: {len(labelled)} rows\n")
        return
    with show_progress(quiet=quiet) as log:
        verdicts = []
        for done, row in enumerate(labelled, start=1):
            found = judging.read_submission(Path(str(folder)), row["id"], intersection=intersection)
            verdicts.append(judging.judge(row, found))
            if done % 50 == 0:
                log("judging", f"{done} of {len(labelled)} instructions")
            stop_if_asked()
    if all(each.outcome.endswith("refused") for each in verdicts):
        raise InputError(f"{folder} holds no scene for any of the instructions; see --rows")
    shares = judging.count_verdicts(verdicts, labelled)
    figures = judging.to_json(shares)
    page = enter_leaderboard(Path(board), str(name), figures) if board else None
    if as_json:
        listed = [vars(each) for each in verdicts]
        write_json({"ok": True, "folder": folder, **figures, "verdicts": listed})
    else:
        write_stdout(judging.to_markdown(shares, verdicts))
    if page is not None:
        log_line(f"written: {board}, {page}")
