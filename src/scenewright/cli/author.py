"""`scenewright author`: a scene made by an agent that calls the stages as tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.cli.console import format_one_line, log_line, show_progress, write_result
from scenewright.cli.options import BaseUrl, Json, Quiet, TimeLimit, Timeout, argument, option
from scenewright.time_limit import DEFAULT_LIMIT

if TYPE_CHECKING:
    from collections.abc import Callable

_SECONDS, _MOST_TOKENS = 120.0, 4096


def author(
    text: str = argument(..., "What shall happen; `-` reads it from stdin."),
    model: str | None = option(
        None,
        "Model that calls the tools, such as openai:MODEL; else a fixed router.",
        metavar="NAME",
    ),
    base_url: BaseUrl = None,
    timeout: Timeout = None,
    time_limit: TimeLimit = DEFAULT_LIMIT,
    intersection: str = option("amsterdam_120", "Where it happens."),
    seed: int = option(0, "Of everything drawn.", min=0),
    most_calls: int = option(24, "Most calls of tools.", min=1, max=200),
    out: str | None = option(None, "Folder to write; scenes/ID if none."),
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Have an agent make a scene by calling the stages as tools: a model, or a fixed router."""
    from scenewright.authoring.agent import author as authored
    from scenewright.authoring.agent import format_provenance
    from scenewright.cli.make import SCENES, choose_folder_name, read_instruction
    from scenewright.cli.output_folder import fill_folder, target_folder, try_folder
    from scenewright.cli.scene_summary import format_verdict
    from scenewright.files import write_atomically
    from scenewright.graph.run import encode_proof, encode_scene

    instruction = read_instruction(text)
    target = None if out is None else target_folder(out, force=None)
    try_folder(out or SCENES)
    chat_model, hide = _load_model(model, base_url, timeout)
    with show_progress(quiet=quiet) as log:
        made = authored(
            instruction,
            model=chat_model,
            intersection=intersection,
            seed=seed,
            most_calls=most_calls,
            time_limit=time_limit,
            log=log,
            hide=hide,
        )
    if target is None:
        name = choose_folder_name(made.record.meta.scene_id)
        target = target_folder(str(Path(SCENES) / name), force=False)
    with fill_folder(target) as part:
        write_atomically(part / "provenance.json", format_provenance(made, seed=seed, model=model))
        write_atomically(part / "proof.json", encode_proof(made.proof))
        write_atomically(part / "scene.json", encode_scene(made.record))
        files = sorted(entry.name for entry in part.iterdir())
    if not quiet:
        for name, fine in made.calls:
            log_line(f"  {format_one_line(name, limit=40)}{'' if fine else ': refused'}")
        log_line(format_verdict(made.proof))
    calls = [{"tool": name, "ok": fine} for name, fine in made.calls]
    facts = {"folder": str(target), "files": files, "calls": calls, **made.proof.build_verdict()}
    write_result(facts, f"{target}\n", as_json=as_json)


def _load_model(
    name: str | None, base_url: str | None, timeout: float | None
) -> tuple[Any, Callable[[str], str]]:
    """The chat model, and what hides its key in whatever is said of it."""
    if name is None:
        return None, lambda text: text
    from scenewright.backends.chat.naming import load_chat_model
    from scenewright.backends.chat.retry import quote

    endpoint = load_chat_model(
        name, base_url=base_url, timeout=timeout or _SECONDS, max_tokens=_MOST_TOKENS
    )
    return endpoint.model, lambda text: quote(text, endpoint.key)
