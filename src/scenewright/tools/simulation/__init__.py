"""Traffic simulated with SUMO: networks, demand, runs and the corpus made of them."""
