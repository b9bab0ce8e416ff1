"""The learned refiner (paper Eq. 7): `Refiner`, `predict`, `run_rollout`, `train`, `load_refiner`.

Import from the modules; this package loads nothing by itself, because torch takes a second.
"""
