"""What the shipped bundle and networks are made with: run from a clone, not part of the wheel."""
