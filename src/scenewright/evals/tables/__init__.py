"""Every table of the paper on a dataset of ours, beside the paper's own numbers.

`paper.toml` holds those numbers, `reading` a dataset and Table 2, `likelihood` NLL and S2R of
agents, Tables 1, 4 and 5, `nearness` how scenes move against a corpus and real tracks, `diversity`
whether they differ as much as real ones, `report` one page of it all.
"""
