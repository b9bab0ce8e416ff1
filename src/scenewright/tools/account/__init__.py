"""The account of words: which words of the texts in force a finished scene shows (SEMANTICS 9).

It shares no code with any reader, prompt or edit: it cuts the texts into words itself, claims what
they mean of the scene, and tests each claim on what the relation checker found.
"""

from scenewright.tools.account.account import list_unknown_words, prove, write_account
from scenewright.tools.account.changes import find_unasked_changes
from scenewright.tools.account.standing_facts import blank_standing_facts

__all__ = [
    "blank_standing_facts",
    "find_unasked_changes",
    "list_unknown_words",
    "prove",
    "write_account",
]
