"""Many scenes in one run: rows in, a folder of scenes out, however often the run is killed.

`rows` reads and names what is asked for, `work` makes one row's scene, `pool` and `cluster` do so
on many processes or machines, `journal` remembers what is done, `carry_out` writes folders,
`finish` makes the dataset's tables, card and manifest, `run` puts all of it together.
"""
