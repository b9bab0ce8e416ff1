"""Floor 0: the vocabulary. Values only; nothing here computes a scene."""
