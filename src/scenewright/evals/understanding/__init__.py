"""Section 5: who leaves where, and who will have to do with whom, from the first seconds alone.

`evaluate` scores a method on a folder of scenes; `observe` makes what a method may see. The page
docs/understanding.md defines the tasks.
"""
