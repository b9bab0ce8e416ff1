"""`scenewright evals satisfaction`: scenes of any program against instructions of other people."""

from __future__ import annotations

import json
from pathlib import Path

from scenewright.cli.common_options import BoardOptions, Json, Quiet, argument, option
from scenewright.cli.console import log_line, show_progress, write_result, write_stdout
from scenewright.cli.interrupts import stop_if_asked
from scenewright.errors import InputError


def score_satisfaction(
    *,
    folder: str | None = argument(
        None, "ID/scene.json, or ID.SUFFIX: tracks, for each row.", metavar="DIR"
    ),
    rows: str | None = option(
        None, "Write the instructions as rows for `batch`.", metavar="F.jsonl"
    ),
    intersection: str = option(
        "amsterdam_120", "Map of submitted tracks; a scene.json names its own."
    ),
    entry: BoardOptions,
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
    page = enter_leaderboard(Path(entry.board), str(entry.name), figures) if entry.board else None
    facts = {"folder": folder, **figures, "verdicts": [vars(each) for each in verdicts]}
    write_result(facts, judging.to_markdown(shares, verdicts), as_json=as_json)
    if page is not None:
        log_line(f"written: {entry.board}, {page}")
