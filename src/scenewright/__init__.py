"""scenewright: an instruction in plain language in, a verified, annotated traffic scene out.

    from scenewright import synthesize, verify

    scene = synthesize("A vehicle yields to a pedestrian at 8 am", seed=7)
    proof = verify(scene)

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
    from scenewright.graph.run import Scene, synthesize, verify
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
    "plan",
    "synthesize",
    "verify",
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
    "verify": ("scenewright.graph.run", "verify"),
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
