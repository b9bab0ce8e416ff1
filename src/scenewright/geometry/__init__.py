"""Paths, positions along them and motion on them, for everything but the relation checker."""
