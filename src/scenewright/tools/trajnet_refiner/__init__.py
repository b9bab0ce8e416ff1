"""The learned refiner (paper Eq. 7): `Refiner`, `predict`, `roll_out`, `train`, `load_refiner`.

Import from the modules; this package loads nothing by itself, because torch takes a second.
"""
