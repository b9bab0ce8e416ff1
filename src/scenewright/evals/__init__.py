"""Evaluations: figures with their intervals (`bootstrap`) as cells of tables (`records`)."""
