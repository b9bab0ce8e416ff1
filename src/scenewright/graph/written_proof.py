"""A proof.json and a provenance.json beside a scene, held against what the checker finds now."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenewright.graph.scene_files import read_origin_digest
from scenewright.scene.events import Finding, Proof

ROUNDING = 0.011
"""Figures may differ by this from machine to machine: most are kept to 1 mm or 0.001 s."""


def find_contradiction(
    found: Proof, written: Proof | None, *, strict: bool, other_map: bool = False
) -> Finding | None:
    """Why a written proof is not that of a scene, beside what the checker found in it.

    Args:
        strict: whether there must be one that names the digest and agrees in every figure.
        other_map: whether another map was looked at, on which there may be other events.
    """
    keys = None if strict else () if other_map else ("verified", "events")
    if written is None:
        return _report("proof_missing", "no proof.json names the digest") if strict else None
    if written.scene_digest is None and strict:
        return _report(
            "proof_missing", "proof.json names no digest; it was made before there was one"
        )
    if written.scene_digest not in (None, found.scene_digest):
        return _report(
            "scene_changed",
            f"proof.json is that of {written.scene_digest}, the scene is {found.scene_digest}: "
            "it was changed since, or the proof belongs to another scene",
        )
    place = _find_first_difference(_convert_to_json(written, keys), _convert_to_json(found, keys))
    if place is None:
        return None
    return _report("proof_contradicted", f"proof.json has another {place} than the checker finds")


def find_other_origin(found: Proof, file: Path) -> Finding | None:
    """That a provenance.json names another scene than the one that was checked."""
    if read_origin_digest(file) in (None, found.scene_digest):
        return None
    return _report("provenance_contradicted", "provenance.json is that of another scene")


def _report(rule: str, detail: str) -> Finding:
    return Finding(rule=rule, agents=(), detail=detail)


def _convert_to_json(proof: Proof, keys: tuple[str, ...] | None) -> dict[str, Any]:
    plain = proof.model_dump(mode="json", by_alias=True)
    plain.pop("scene_digest", None)
    return plain if keys is None else {key: plain[key] for key in keys}


def _find_first_difference(one: Any, two: Any, place: str = "") -> str | None:
    """Where two JSON values differ by more than rounding, such as `events.0.time`."""
    if isinstance(one, Mapping) and isinstance(two, Mapping):
        keys = one.keys() | two.keys()
        parts = [(key, one.get(key), two.get(key)) for key in sorted(keys)]
    elif isinstance(one, list) and isinstance(two, list) and len(one) == len(two):
        parts = [(str(k), *pair) for k, pair in enumerate(zip(one, two, strict=True))]
    else:
        numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in (one, two))
        same = abs(one - two) <= ROUNDING if numbers else one == two
        return None if same else place or "content"
    found = (_find_first_difference(a, b, f"{place}.{key}".lstrip(".")) for key, a, b in parts)
    return next((each for each in found if each is not None), None)
