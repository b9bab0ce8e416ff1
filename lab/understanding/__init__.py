"""What is fitted on scenes of development for early predictions."""
