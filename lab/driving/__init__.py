"""The learned ego."""
