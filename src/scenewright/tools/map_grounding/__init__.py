"""Map grounding (paper 3.1): agents and relations bound to routes and signals of a map."""
