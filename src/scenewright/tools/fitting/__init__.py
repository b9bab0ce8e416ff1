"""Fitting of priors on corpora, recorded tracks and simulated traffic; bundles of them."""
