"""`scenewright author`: a scene made by an agent that calls the stages as tools."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from scenewright.cli.console import ProgressCallback, Result
from scenewright.cli.options import EndpointOptions, PlaceOptions, argument, option
from scenewright.cli.output_folder import plan_folder
from scenewright.cli.views import save_scene

_SECONDS, _MOST_TOKENS = 120.0, 4096


@dataclass(frozen=True)
class AuthorOptions(PlaceOptions, EndpointOptions):
    """How the agent that makes a scene is asked."""

    model: str | None = option(
        None,
        "Model that calls the tools, such as openai:MODEL; else a fixed router.",
        metavar="NAME",
    )
    seed: int = option(0, "Of everything drawn.", min=0)
    most_calls: int = option(24, "Most calls of tools.", min=1, max=200)


def author(
    *,
    text: str = argument(..., "What shall happen; `-` reads it from stdin."),
    options: AuthorOptions,
    out: str | None = option(None, "Folder to write; scenes/ID if none."),
    log: ProgressCallback,
) -> Result:
    """Have an agent make a scene by calling the stages as tools: a model, or a fixed router."""
    from scenewright.authoring.agent import author as authored
    from scenewright.authoring.agent import format_provenance
    from scenewright.cli.make import read_instruction
    from scenewright.cli.scene_summary import format_verdict
    from scenewright.graph.scene_files import encode_proof, encode_scene

    instruction, choose = read_instruction(text), plan_folder(out, force=None)
    model, hide = _load_model(options)
    asked = options.pass_on(authored) | {"model": model}
    made = authored(instruction, log=log, hide=hide, **asked)
    provenance = format_provenance(made, seed=options.seed, model=options.model)
    contents = {"provenance.json": provenance, "proof.json": encode_proof(made.proof),
                "scene.json": encode_scene(made.record)}  # fmt: skip
    folder, files, _ = save_scene(choose(made.record.meta.scene_id), contents, {})
    calls = [{"tool": name, "ok": fine} for name, fine in made.calls]
    return Result(
        {"folder": str(folder), "files": files, "calls": calls, **made.proof.build_verdict()},
        f"{folder}\n",
        summary=[
            *(f"  {name}{'' if fine else ': refused'}" for name, fine in made.calls),
            format_verdict(made.proof),
        ],
    )


def _load_model(options: AuthorOptions) -> tuple[Any, Callable[[str], str]]:
    """The chat model, and what hides its key in whatever is said of it."""
    if options.model is None:
        return None, lambda text: text
    from scenewright.backends.chat.naming import load_chat_model
    from scenewright.backends.chat.retry import quote

    endpoint = load_chat_model(
        options.model, base_url=options.base_url, timeout=options.timeout or _SECONDS,
        max_tokens=_MOST_TOKENS,
    )  # fmt: skip
    return endpoint.model, lambda text: quote(text, endpoint.key)
