"""What can go wrong, drawn as a tree.

    ScenewrightError
    ├── InputError          the caller's input is at fault; a clear line for each fault, exit code 2
    │   └── BusyError       another turn of the conversation is being worked on
    ├── Unsatisfiable       a sane request that cannot be met; carries every rejection, exit code 3
    │   └── OutOfTime       the time limit was reached before it was met or given up
    ├── BackendFault        a backend failed for good, or never answered usably, exit code 4
    └── Rejected            wraps a `Rejection` on its way to a retry edge; never reaches a user

Anything else that is raised is a bug and is never caught.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pydantic import ValidationError

    from scenewright.scene.rejection import Rejection


class ScenewrightError(Exception):
    """Base of every error that scenewright raises on purpose.

    Attributes:
        code: of its kind, for programs; exit_code: of the process that ends with it.
        models: what models were asked and took until then, by task, as provenance has it.
        called: how people call the agents of the plan that came to nothing, by name.
    """

    code = "internal_error"
    exit_code = 1

    def __init__(self, *words: object) -> None:
        super().__init__(*words)
        self.models: Mapping[str, Any] = {}
        self.called: Mapping[str, str] = {}


class InputError(ScenewrightError):
    """The input cannot be used; the message says what was wrong and how to mend it.

    Attributes:
        lines: the message; one line for each fault of a file.
    """

    code = "unusable_input"
    exit_code = 2

    def __init__(self, *lines: object) -> None:
        super().__init__("\n".join(map(str, lines)))
        self.lines = tuple(map(str, lines))


class BusyError(InputError):
    """Another turn of the conversation is still being worked on."""


class Unsatisfiable(ScenewrightError):
    """The request was understood but no verified scene exists within the budget.

    Attributes:
        rejections: every rejection on the way, oldest first.
    """

    code = "unsatisfiable"
    exit_code = 3

    def __init__(self, message: str, rejections: tuple[Rejection, ...] = ()) -> None:
        super().__init__(message)
        self.rejections = rejections


class OutOfTime(Unsatisfiable):
    """The time limit of the request was reached; a longer one, or a faster machine, may do."""


class BackendFault(ScenewrightError):
    """The backend that answers stage prompts failed (transport, timeout, key).

    Attributes:
        final: it was asked as often as makes sense, or asking again cannot help.
        asked: how often the request was sent, where one was.
        rejections: what was wrong with its answers, oldest first, where it gave any.
    """

    code = "backend_failed"
    exit_code = 4

    def __init__(
        self,
        message: str,
        *,
        final: bool = False,
        asked: int = 0,
        rejections: tuple[Rejection, ...] = (),
    ) -> None:
        super().__init__(message)
        self.final = final
        self.asked = asked
        self.rejections = rejections


class Rejected(ScenewrightError):
    """A stage's product was refused; routed along a retry edge.

    Attributes:
        rejection: the value that the retried stage can act on.
        kept: by channel, what the stage made before it refused and does not have to make again.
    """

    def __init__(self, rejection: Rejection, *, kept: Mapping[str, Any] | None = None) -> None:
        super().__init__(f"{rejection.stage}/{rejection.code}: {rejection.detail}")
        self.rejection = rejection
        self.kept: Mapping[str, Any] = kept or {}


def describe_misfit(error: ValidationError, whole: str = "") -> str:
    """The first fault that pydantic found: the field, or what `whole` is called, and what it is."""
    first = error.errors(include_url=False)[0]
    place = ".".join(map(str, first["loc"])) or whole
    return f"{place}: {first['msg']}" if place else first["msg"]
