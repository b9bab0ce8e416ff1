"""What went wrong, as one line for people and one object for machines."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from scenewright.cli.console import format_one_line
from scenewright.cli.interrupts import has_stop_signal, has_terminate_signal
from scenewright.errors import BackendFault, InputError, OutOfTime, ScenewrightError, Unsatisfiable

NOT_VERIFIED = 1
UNUSABLE = 2
INTERNAL = 70
INTERRUPTED = 130
READER_GONE = 141
TERMINATED = 143

_ADVICE = {
    "contradictory": "Change or drop one of the two.",
    "impossible": "`scenewright intersections show NAME` lists what there is.",
    "ungroundable": "`scenewright intersections show NAME` lists what there is.",
    "role_mismatch": "Ask for other movements, or leave them open.",
    "unknown_direction": "`scenewright intersections show NAME` lists the legs.",
    "no_surviving_combination": "Another --seed, less traffic or fewer fixed directions may help.",
    "background_interferes": "Another --seed or less background traffic may help.",
    "relation_not_realised": "Another --seed or a less exact request may help.",
    "wrong_braker": "Another --seed or a less exact request may help.",
    "implausible_motion": "Another --seed or a less severe event may help.",
    "unlawful": "Say that the light is run, or drop --lawful (orders: --no-lawful).",
    "work_spent": "Another --seed, less traffic or a less exact request may help.",
}


@dataclass(frozen=True)
class CliError:
    """A failure as the command line reports it.

    Attributes:
        code: for machines; exit_code: of the process.
        reason: one sentence, or a line for each fault of a file.
        details: further keys of the JSON object.
    """

    code: str
    exit_code: int
    reason: str
    details: dict[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The object that `--json` prints."""
        about = {"code": self.code, "exit_code": self.exit_code, "reason": self.reason}
        return {"ok": False, **about, **self.details}


def to_cli_error(error: BaseException) -> CliError:
    """The error object of an exception; an unexpected one is `internal_error`."""
    if isinstance(error, KeyboardInterrupt) or has_stop_signal():
        code = TERMINATED if has_terminate_signal() else INTERRUPTED
        return CliError("interrupted", code, "interrupted; nothing was written")
    # What models were asked until then, if any were.
    asked = dict(error.models) if isinstance(error, ScenewrightError) else {}
    costs = {"models": asked} if asked else {}
    match error:
        case Unsatisfiable():
            return _describe_unsatisfiable(error, costs)
        case InputError() | BackendFault():
            lines = error.lines if isinstance(error, InputError) else [str(error)]
            reason = "\n".join(map(format_one_line, lines))
            return CliError(error.code, error.exit_code, reason, costs)
        case MemoryError():
            return CliError("out_of_memory", UNUSABLE, "there is not enough memory for this")
        case OSError():
            what = error.strerror or str(error) or type(error).__name__
            line = f"{what}: {error.filename}" if error.filename else what
            return CliError("unusable_input", UNUSABLE, format_one_line(line))
    # typer brings a private copy of click, so its base class has no stable import path.
    message = getattr(error, "format_message", None)
    if message is not None:
        return CliError("unusable_input", UNUSABLE, format_one_line(message()))
    reason = f"this is a fault in scenewright: {type(error).__name__}: {error}"
    line = f"{reason} (SCENEWRIGHT_TRACEBACK=1 shows where)"
    return CliError("internal_error", INTERNAL, format_one_line(line))


def _describe_unsatisfiable(error: Unsatisfiable, costs: dict[str, Any]) -> CliError:
    codes = [rejection.code for rejection in error.rejections]
    advice = _ADVICE.get(codes[-1]) if codes else None
    if isinstance(error, OutOfTime):
        advice = "A longer --time-limit, another --seed or a less exact request may help."
    details: dict[str, Any] = {
        "advice": advice,
        "rejections": [rejection.model_dump(mode="json") for rejection in error.rejections],
        **costs,
    }
    reason = format_one_line(str(error))
    if advice is not None and not reason.endswith((".", "!", "?")):
        reason += "."
    line = reason if advice is None else f"{reason} {advice}"
    return CliError(error.code, error.exit_code, line, details)
