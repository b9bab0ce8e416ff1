"""Training of the refiner for the TrajNet++ benchmark."""
