"""Section 5: exits and relations of a scene, predicted from its first seconds alone.

`evaluate` scores a method on a folder of scenes; `cases` makes what a method may see. The
page docs/understanding.md defines the tasks.
"""
