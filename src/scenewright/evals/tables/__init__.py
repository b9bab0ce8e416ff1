"""Every table of the paper on a dataset of ours, beside the paper's own numbers.

`paper` holds those numbers, `reading` a dataset, `likelihood` NLL and S2R of agents,
`fidelity_tables` Tables 1, 4 and 5, `robustness` Table 2, `nearness` how scenes move against a
corpus and real tracks, `diversity` whether they differ as much as real ones, `report` one page of
it all.
"""
