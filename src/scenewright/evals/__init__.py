"""scenewright."""
