"""What the server of workers loads before any is forked: all that a first scene needs.

Importing it makes a scene, which loads libraries, priors, the reader and machine code.
"""

from __future__ import annotations

from contextlib import suppress

from scenewright.graph.run import synthesize

with suppress(Exception):  # a worker that meets the same fault says which row it was
    synthesize("A car yields to a pedestrian", seed=0)
