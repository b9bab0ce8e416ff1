"""A hook of MkDocs: links that leave the docs folder become the path that they lead to, as code."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import Any

_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(((?:\.\./)+[^)\s]+)\)")


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The page, in which `[text](../src/x.py)` reads `text (`src/x.py`)`."""
    depth = len(PurePosixPath(page.file.src_uri).parts)

    def rewrite(link: re.Match[str]) -> str:
        text, target = link.groups()
        if target.count("../") < depth:
            return link.group(0)
        return f"{text} (`{target.replace('../', '')}`)"

    return _LINK.sub(rewrite, markdown)
