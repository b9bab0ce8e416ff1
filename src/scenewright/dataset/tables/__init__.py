"""Scenes in the formats of others. Each module writes one format from plain values."""
