"""scenewright: an instruction in plain language in, a verified, annotated traffic scene out.

    from scenewright import synthesize, verify

    scene = synthesize("A vehicle yields to a pedestrian at 8 am", seed=7)
    proof = verify(scene)

**In** goes an instruction, a `SocialGraph` or a plan file; with the seed it decides every byte of
what comes out, where the builtin backend plans.

**Out** comes a `Scene`: its `record` (scene.json), its `proof` (proof.json), which the checker has
found on the finished tracks and which says `verified`, and its `provenance`. `verify` finds the
same proof again from the record alone, `verify_tracks` the events in tracks made elsewhere.

**Refused** is the rest, with a reason: `InputError`, what cannot be read or is no request for a
scene; `Unsatisfiable`, a request that cannot be met, with every rejection on the way (`OutOfTime`:
not within its time limit); `BackendFault`, a backend that failed for good. Any other exception is a
fault of scenewright. The errors are in `scenewright.errors`.

Nothing is loaded until it is used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenewright.backends import load_backend
    from scenewright.cli.plan import plan
    from scenewright.driving.api import drive, drive_many
    from scenewright.graph.export import export
    from scenewright.graph.run import Scene, synthesize
    from scenewright.graph.verify import load_tracks, verify, verify_tracks
    from scenewright.intersections import load_map as load_intersection
    from scenewright.scene.map import IntersectionMap
    from scenewright.scene.social import SocialGraph

    __version__: str

__all__ = [
    "IntersectionMap",
    "Scene",
    "SocialGraph",
    "__version__",
    "drive",
    "drive_many",
    "export",
    "load_backend",
    "load_intersection",
    "load_tracks",
    "plan",
    "synthesize",
    "verify",
    "verify_tracks",
]

_HOMES = {
    "drive": ("scenewright.driving.api", "drive"),
    "drive_many": ("scenewright.driving.api", "drive_many"),
    "export": ("scenewright.graph.export", "export"),
    "IntersectionMap": ("scenewright.scene.map", "IntersectionMap"),
    "Scene": ("scenewright.graph.run", "Scene"),
    "SocialGraph": ("scenewright.scene.social", "SocialGraph"),
    "load_backend": ("scenewright.backends", "load_backend"),
    "load_intersection": ("scenewright.intersections", "load_map"),
    "plan": ("scenewright.cli.plan", "plan"),
    "synthesize": ("scenewright.graph.run", "synthesize"),
    "load_tracks": ("scenewright.graph.verify", "load_tracks"),
    "verify": ("scenewright.graph.verify", "verify"),
    "verify_tracks": ("scenewright.graph.verify", "verify_tracks"),
}


def __getattr__(name: str) -> Any:
    """Public names, loaded on first use."""
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("scenewright")
    elif name in _HOMES:
        module, attribute = _HOMES[name]
        value = getattr(import_module(module), attribute)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
