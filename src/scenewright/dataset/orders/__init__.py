"""An agent that fills an order: `40 collisions and 50 yields at rush hour` in, a dataset out.

`wish` reads the order, `story` decides what each scene is to show, `voices` words it in the manner
of many writers, `writers` are who words it, `book` remembers what was written, `agent` is the
LangGraph that connects these with the pipeline, `report` says what came of the order.
"""
