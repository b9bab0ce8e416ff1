"""TrajNet++: real pedestrians, scored by the benchmark's rules (Kothari, Kreiss & Alahi 2021)."""
