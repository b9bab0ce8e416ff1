"""Forged proofs, and forged scenes whose forger wrote a new digest: what does `verify` catch?

    python benchmarks/forged_proofs.py [--seed 3] [--json FILE]

As `forgeries.py`, for scenes with groups, objects that block the view, reactions, figures asked for
and ways of moving, in three ways:

- proof: one value of an honest scene's proof.json is changed (events, evidence, figures, reactions,
  account of words, digest), for every place in it;
- field: one value of the fields that came last is changed in scene.json (rules, reactions, motions,
  groups, objects, sights, measures, relations, lights, account of words);
- rewritten: the same, and the forger puts the forged scene's digest into the proof.

All are verified with --strict. A proof that lacks a key with its usual value reads as before: such
are counted apart (`usual`), as they are no forgeries. `rewritten` is what no digest can betray:
there only tracks, map, the file's other fields and the proof's figures are left; what they do not
betray is listed.
"""

from __future__ import annotations

import copy
import json
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from forgeries import forge_as_asked, verify_forgery
from pydantic import ValidationError

from scenewright import synthesize
from scenewright.errors import InputError, Unsatisfiable
from scenewright.graph.scene_files import load_scene
from scenewright.scene.digest import digest_scene
from scenewright.scene.events import Proof

Json = Any
Place = tuple[str | int, ...]
SCENES = {
    "group": "A couple crosses the north crosswalk and a car turning right yields to them",
    "object": "A child runs out from behind a parked van and is hit by a car",
    "no reaction": "A distracted driver hits a pedestrian",
    "figure": "A car driving 40 km/h narrowly misses a pedestrian with a PET of 1.0 s",
    "motion": "A running pedestrian is nearly hit by a car",
    "rider": "A right-turning van cuts off a cyclist",
    "red light": "A car runs the red light and hits a car from the left",
    "door": "A cyclist is doored by a parked van",
    "chain": "A truck rear-ends a car and pushes it into the van ahead",
    "cut in": "A car cuts in ahead of a bus with a headway of 0.6 s",
}
LAST = ("rules", "reaction", "motion", "group", "objects", "sights", "measures", "signals",
        "relations", "ties", "said", "violates_signal", "subtype", "encounters")  # fmt: skip
"""Keys of scene.json whose values are changed."""
WAYS = ("proof", "usual", "field", "rewritten")
MOST_OF_A_KIND = 2
"""Places of one kind in one scene that are forged."""


def list_places(value: Json, at: Place = ()) -> Iterator[Place]:
    """Every place that holds a value, inner ones last."""
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    for key, each in inner:
        yield (*at, key)
        if isinstance(each, dict | list):
            yield from list_places(each, (*at, key))


def name_kind(place: Place) -> str:
    """The place without the numbers of rows."""
    return ".".join("*" if isinstance(key, int) else key for key in place)


def list_others(value: Json) -> Iterator[tuple[str, Json]]:
    """Other values for a place; the last one takes it out."""
    match value:
        case bool():
            yield "turned", not value
        case int() | float():
            yield "other number", value + 1
            yield "0.05 more", value + 0.05
        case str():
            yield "other text", value + "x"
        case None:
            yield "a number", 1
        case [_, *_]:
            yield "empty", []
            yield "first twice", [value[0], *value]
        case {}:
            yield "empty", {}
    if value is not None:
        yield "null", None


def forge_each(document: Json, keys: tuple[str, ...] | None) -> Iterator[tuple[str, Json]]:
    """Kind of forgery, and the document with it, for all places (below one of the keys)."""
    seen: dict[str, int] = defaultdict(int)
    for place in list_places(document):
        kind = name_kind(place)
        if (keys is not None and not set(keys) & set(place)) or seen[kind] >= MOST_OF_A_KIND:
            continue
        seen[kind] += 1
        *outer, last = place
        for how, other in (*list_others(_get(document, place)), ("gone", ...)):
            if other == _get(document, place):
                continue  # empty as it was
            forged = copy.deepcopy(document)
            inside = _get(forged, tuple(outer))
            if other is ...:
                del inside[last]
            else:
                inside[last] = other
            yield f"{kind}: {how}", forged


def _get(value: Json, place: Place) -> Json:
    for key in place:
        value = value[key]
    return value


def write_digest(scene: Json, proof: Json, folder: Path) -> bytes | None:
    """The proof with the digest of the forged scene; None if it is no scene at all."""
    (folder / "scene.json").write_text(json.dumps(scene))
    try:
        digest = digest_scene(load_scene(folder))
    except (InputError, ValueError):
        return None
    return json.dumps({**proof, "scene_digest": digest}).encode()


def name_way(proof: Json, forged: Json) -> str:
    """Whether a changed proof is a forgery, or reads as before."""
    try:
        same = Proof.model_validate(forged) == Proof.model_validate(proof)
    except ValidationError:
        return "proof"
    return "usual" if same else "proof"


def make_scene(text: str, folder: Path, seed: int) -> None:
    """A scene of the text in a folder, with the first of five seeds that makes one."""
    for each in range(seed, seed + 5):
        with suppress(Unsatisfiable):
            synthesize(text, seed=each, refiner="none", max_agents=8).save(folder)
            return
    raise SystemExit(f"no scene of {text!r}")


def forge_all(folder: Path, seed: int) -> Iterator[tuple[str, str, str, str | None]]:
    """Scene, way, kind of forgery, and what betrays it."""
    for name, text in SCENES.items():
        make_scene(text, folder, seed)
        honest = json.loads((folder / "scene.json").read_bytes())
        proof = json.loads((folder / "proof.json").read_bytes())
        if verify_forgery(honest, json.dumps(proof).encode(), folder) is not None:
            raise SystemExit(f"the honest scene {name} is not verified")
        for kind, forged in forge_each(proof, None):
            found = verify_forgery(honest, json.dumps(forged).encode(), folder)
            yield name, name_way(proof, forged), kind, found
        for kind, forged in forge_each(honest, LAST):
            found = verify_forgery(forged, json.dumps(proof).encode(), folder)
            yield name, "field", kind, found
            again = write_digest(forged, proof, folder)
            if again is not None:
                yield name, "rewritten", kind, verify_forgery(forged, again, folder)


def main() -> None:
    """Forges, verifies and prints what was caught."""
    rows = forge_as_asked(__doc__, forge_all)
    for way in WAYS:
        mine = [(kind, found) for _, each, kind, found in rows if each == way]
        kinds: dict[str, list[bool]] = defaultdict(list)
        for kind, found in mine:
            kinds[kind].append(found is not None)
        caught = sum(found is not None for _, found in mine)
        print(f"{way}: {len(mine)} forgeries of {len(kinds)} kinds, {caught} caught")
        for kind, each in sorted(kinds.items()):
            if not all(each):
                print(f"  {kind}: {sum(each)} / {len(each)}")
    passed = [kind for _, way, kind, found in rows if way in ("proof", "field") and found is None]
    if passed:
        sys.exit("passed --strict: " + "; ".join(passed))


if __name__ == "__main__":
    main()
