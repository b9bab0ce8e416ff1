"""An agent that fills an order: `40 collisions and 50 yields at rush hour` in, a dataset out.

`order_spec` reads the order, `scenario_spec` decides what each scene is to show, `templates` hold
texts in many styles, `writers` write an instruction from a template or with a model, `wording`
keeps what was written, `agent` goes round by round through the pipeline, `run` carries an order out
and reports on it.
"""
