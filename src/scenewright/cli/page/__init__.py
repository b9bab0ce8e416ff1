"""`scenewright serve`: a local page on which scenes are made, changed, seen and shared."""
