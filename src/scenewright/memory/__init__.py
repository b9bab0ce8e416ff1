"""Memory: the state within a run (checkpoints and episodes are to come)."""
