"""Views of a scene: still, animation, page; and pictures of an intersection alone."""

from scenewright.viz.animation import animate_scene
from scenewright.viz.html_player import write_player
from scenewright.viz.intersection_picture import draw_intersection
from scenewright.viz.still import draw_scene

__all__ = ["animate_scene", "draw_intersection", "draw_scene", "write_player"]
