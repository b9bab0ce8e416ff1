"""Driving an ego through a scene: stepping core, built-in egos, `gymnasium` environment, report."""
