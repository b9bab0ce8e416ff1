"""Which earlier version words mean that describe it: "the close one", "before the van came"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from scenewright.authoring.thread_state import ThreadState, Version, list_lineage
from scenewright.backends.offline import CLASSES, WORDS, Patterns
from scenewright.scene.edits import Edit, diff_graphs
from scenewright.scene.social import SocialGraph

_PATTERNS = Patterns("find_version")

_EVENT_WORDS = {"collide_at": "crash", "near_miss": "miss", "yield_to": "yield", "follow": "follow"}


def goes_back(words: str) -> bool:
    """Whether words such as "go back to the collision" ask for an earlier version."""
    return _PATTERNS.goes_back.search(words.lower()) is not None


def find_version(words: str, state: ThreadState) -> int | None:
    """The number of the version that the words describe; None where they fit none."""
    plain = words.lower().replace("’", "'")
    versions = state.get("versions", [])
    if not versions:
        return None
    if _PATTERNS.newest.search(plain):
        return max(version["number"] for version in versions)
    for pattern in (_PATTERNS.before, _PATTERNS.without):
        if (found := pattern.search(plain)) and (number := _find_absence(found["what"], state)):
            return number
    wanted = _list_tokens(plain)
    scored = [(_score(wanted, version, versions), version["number"]) for version in versions
              if version["number"] != state.get("current")]  # fmt: skip
    best = max(scored, default=(0.0, 0))
    if best[0] > 0:
        return best[1]
    return versions[0]["number"] if _PATTERNS.first.search(plain) else None


def find_removal(words: str, state: ThreadState) -> tuple[int, tuple[Edit, ...]] | None:
    """The version that took away what the words want back, and the edits that bring it back.

    The latest one counts of those that the current version comes from; "it" is whatever went.
    """
    found = _PATTERNS.returns.search(words.lower().strip(" .!"))
    if found is None:
        return None
    wanted = _list_tokens(found["what"])
    for version, parent in pairwise(list_lineage(state)):
        now, before = (SocialGraph.model_validate(each["graph"]) for each in (version, parent))
        was, there = _list_kinds(before), _list_kinds(now)
        gone = {kind for name, kinds in was.items() if name not in there for kind in kinds}
        if gone and (gone & wanted or not wanted):
            return version["number"], diff_graphs(now, before)
    return None


def _list_kinds(graph: SocialGraph) -> dict[str, set[str | None]]:
    """By id, what may be said of an agent or an object: its class, or kind, and its subtype."""
    agents = {agent.id: {agent.type, agent.subtype, agent.id} for agent in graph.agents}
    return agents | {
        scene_object.id: {scene_object.kind, scene_object.subtype, scene_object.id}
        for scene_object in graph.objects
    }


def _find_absence(what: str, state: ThreadState) -> int | None:
    """The version that another was made from, which brought in what is named."""
    wanted = _list_tokens(what)
    for version, parent in pairwise(list_lineage(state)):
        came = (_describe(version) - _describe(parent)) | _list_tokens(version["words"])
        if wanted & came:
            return parent["number"]
    return None


def _score(wanted: set[str], version: Version, versions: Sequence[Version]) -> float:
    """How well a version fits: a word that few versions have counts more."""
    total = 0.0
    for token in wanted & _describe(version):
        total += 1.0 / sum(token in _describe(each) for each in versions)
    return total


def _describe(version: Version) -> set[str]:
    """What a version is called by: its own words, who is in it, what happens, the hour."""
    graph = version["graph"]
    found = _list_tokens(version["words"])
    for each in graph["agents"]:
        found |= {each["type"], each.get("subtype") or each["type"]}
    found |= {_EVENT_WORDS.get(each["type"], each["type"]) for each in graph["relations"]}
    time_of_day = (graph.get("context") or {}).get("time_of_day")
    if time_of_day:
        found.add("day" if 7 <= int(str(time_of_day)[:2]) < 19 else "night")
    return found


def _list_tokens(text: str) -> set[str]:
    """The words that say something, those that mean the same under one name."""
    found = set()
    for word in re.findall(r"[a-z][a-z'-]*|\d+", text.lower()):
        alike = next(
            (name for name, same in WORDS["find_version"]["alike"] if re.fullmatch(same, word)),
            None,
        )
        noun = word[:-1] if word.endswith("s") and word[:-1] in CLASSES else word
        if alike is not None:
            found.add(alike)
        elif noun in CLASSES:
            kind, subtype = CLASSES[noun]
            found |= {noun, subtype or kind}
        elif not _PATTERNS.empty.fullmatch(word):
            found.add(word)
    return found
