"""The graph: nodes, edges, retries, runs and what they write."""
