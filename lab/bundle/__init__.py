"""The shipped intersection: its map, demand, simulated corpus and priors."""
