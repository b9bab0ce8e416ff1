"""How near the refiner stays to tracks that were held out."""
