"""The learned refiner (paper Eq. 7): `network` predicts, `model` and `train` learn with torch.

Import from the modules; this package loads nothing by itself, because torch takes a second.
"""
