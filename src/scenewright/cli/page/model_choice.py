"""The page's planner and reasoner: chosen there; keys come from the environment, never shown."""

from __future__ import annotations

import os
import re
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from scenewright.backends import load_backend
from scenewright.cli.page.answers import answer_safely, read_object, read_text
from scenewright.cli.page.conversations import Conversations
from scenewright.errors import InputError

KEYS = {"anthropic": "ANTHROPIC_API_KEY", "openai": "OPENAI_API_KEY"}
_NAMES = re.compile(r"builtin|(?:anthropic|openai):[\w./:@-]{1,100}")


class ModelChoice:
    """The backend of all conversations, until another is chosen."""

    def __init__(self, conversations: Conversations, name: str) -> None:
        self._conversations = conversations
        self.name = name

    def list_routes(self) -> list[Route]:
        """The addresses of the settings."""
        return [
            Route("/api/settings", answer_safely(self.answer_settings)),
            Route("/api/settings/backend", answer_safely(self.answer_choice), methods=["POST"]),
        ]

    def answer_settings(self, _request: Request) -> Response:
        """The backend, and for which makers of models there is a key."""
        return JSONResponse(self.describe())

    async def answer_choice(self, request: Request) -> Response:
        """Another backend: {"backend", "base_url"?}."""
        asked = await read_object(request)
        name, url = read_text(asked, "backend"), read_text(asked, "base_url", "")
        await run_in_threadpool(self.choose, name, url)
        return JSONResponse(self.describe())

    def describe(self) -> dict[str, Any]:
        """The backend, and whether the environment holds the key of each maker."""
        keys = {key: bool(os.environ.get(key)) for key in KEYS.values()}
        return {"backend": self.name, "keys": keys}

    def choose(self, name: str, base_url: str) -> None:
        """Another backend from now on.

        Raises:
            InputError: there is none such, or its key or package is missing.
        """
        if not _NAMES.fullmatch(name):
            raise InputError("a backend is builtin, anthropic:MODEL or openai:MODEL")
        self._conversations.speak_with(load_backend(name, base_url=base_url or None))
        self.name = name
