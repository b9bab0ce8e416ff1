"""Pictures with matplotlib: a scene as a still and as an animation, an intersection alone."""

from scenewright.graph.picture.animation import animate_scene
from scenewright.graph.picture.intersection import draw_intersection
from scenewright.graph.picture.still import draw_scene

__all__ = ["animate_scene", "draw_intersection", "draw_scene"]
