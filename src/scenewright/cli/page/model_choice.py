"""The page's planner and reasoner: chosen there; keys come from the environment, never shown."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from typing import Any

from scenewright.backends import load_backend
from scenewright.cli.page.asked import BackendChoice
from scenewright.cli.page.conversations import Conversations
from scenewright.errors import InputError

KEYS = {"anthropic": "ANTHROPIC_API_KEY", "openai": "OPENAI_API_KEY"}
_NAMES = re.compile(r"builtin|(?:anthropic|openai):[\w./:@-]{1,100}")


class ModelChoice:
    """The backend of all conversations, until another is chosen."""

    def __init__(self, conversations: Conversations, name: str) -> None:
        self._conversations = conversations
        self.name = name

    def list_answers(self) -> dict[str, Callable[..., Any]]:
        """The addresses of the settings."""
        return {"GET /api/settings": self.describe, "POST /api/settings/backend": self.choose}

    def describe(self) -> dict[str, Any]:
        """The backend, and whether the environment holds the key of each maker."""
        keys = {key: bool(os.environ.get(key)) for key in KEYS.values()}
        return {"backend": self.name, "keys": keys}

    def choose(self, asked: BackendChoice) -> dict[str, Any]:
        """Another backend from now on.

        Raises:
            InputError: there is none such, or its key or package is missing.
        """
        if not _NAMES.fullmatch(asked.backend):
            raise InputError("a backend is builtin, anthropic:MODEL or openai:MODEL")
        self._conversations.speak_with(load_backend(asked.backend, base_url=asked.base_url or None))
        self.name = asked.backend
        return self.describe()
