"""This folder is left out of a plain test run; `make crosscheck` names it, and prints figures."""

from __future__ import annotations

from pathlib import Path

import ledger
import pytest


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leaves the folder out unless it is named on the command line."""
    named = any("crosscheck" in str(word) for word in config.invocation_params.args)
    return None if named or not collection_path.name.startswith("test_") else True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Prints how far the measures lay apart."""
    for line in ledger.lines():
        terminalreporter.write_line(line)
