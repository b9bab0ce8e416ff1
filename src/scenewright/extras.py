"""Optional packages, looked for before any work that needs them is done."""

from __future__ import annotations

from importlib.util import find_spec

from scenewright.errors import InputError


class MissingPackageError(InputError):
    """Something needs an optional package that is not installed."""


def require_extra(extra: str, work: str, *modules: str, otherwise: str = "") -> None:
    """Raise unless the modules that an extra installs are there; none of them is loaded.

    Args:
        extra: of `pyproject.toml`; work: what needs it, in words.
        otherwise: what can be done without it.

    Raises:
        MissingPackageError: one is missing; the line holds the command that installs it.
    """
    words = describe_missing(extra, work, *modules)
    if words is not None:
        raise MissingPackageError(f"{words}, or {otherwise}" if otherwise else words)


def describe_missing(extra: str, work: str, *modules: str) -> str | None:
    """Say which modules of an extra are missing and what installs them; None if none is."""
    missing = [module.replace("_", "-") for module in modules if find_spec(module) is None]
    if not missing:
        return None
    return f"{work} needs {' and '.join(missing)}: pip install 'scenewright[{extra}]'"
