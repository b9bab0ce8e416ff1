"""Datasets of scenes: batches, orders that an agent fills, and tables."""
