"""Any chat model that LangChain reaches, by name: `anthropic:MODEL`, `openai:MODEL`.

With a base URL, an OpenAI-compatible endpoint such as a vLLM server. `naming` makes the model over
the HTTP client of `bounded_client`, `model` puts the question, `retry` says which faults may pass
and asks again after pauses.
"""

from __future__ import annotations

from scenewright.backends.chat.model import ChatModel, Limits
from scenewright.backends.chat.naming import Endpoint, load_chat_model

__all__ = ["ChatModel", "Endpoint", "Limits", "load_chat_model"]
