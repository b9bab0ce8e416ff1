"""Pictures with matplotlib: a scene as a still and as an animation, an intersection alone."""

from scenewright.viz.animation import animate_scene
from scenewright.viz.intersection_picture import draw_intersection
from scenewright.viz.still import draw_scene

__all__ = ["animate_scene", "draw_intersection", "draw_scene"]
