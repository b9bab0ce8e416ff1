"""Realism of generated scenes: how they move, compared with a corpus and with real tracks."""
