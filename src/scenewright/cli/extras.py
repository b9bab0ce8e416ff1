"""Optional packages, looked for before any work is done."""

from __future__ import annotations

from importlib.util import find_spec

from scenewright.errors import InputError


def require_torch(work: str, otherwise: str = "") -> None:
    """Raise unless torch is there, which only training needs.

    Args:
        work: what needs it, in words; otherwise: what can be done without.

    Raises:
        InputError: it is not installed.
    """
    if find_spec("torch") is None:
        instead = f", or {otherwise}" if otherwise else ""
        raise InputError(f"{work} needs torch: pip install 'scenewright[learn]'{instead}")
