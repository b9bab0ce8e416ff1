"""Loops over arrays as machine code: for many short arrays, whose calls into numpy cost most."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def compiled(function: FunctionT) -> FunctionT:
    """The function compiled at its first call, and kept on disk for the next process.

    Rounding is that of the plain function: no operation is reordered or fused. Division by zero
    gives what IEEE 754 says instead of raising. Where nothing can be kept on disk, every process
    compiles for itself.
    """
    try:
        return cast(FunctionT, njit(cache=True, error_model="numpy")(function))
    except RuntimeError:  # neither beside the source nor in the user's cache is a place to write
        return cast(FunctionT, njit(error_model="numpy")(function))
