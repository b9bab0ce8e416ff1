"""Instruction satisfaction, judged from tracks: the events asked for, their agents, and nothing
else.

The instructions are those of `evals.planning`, written by people who had seen no planner. A
submission may come from any program: scenes of scenewright, or tracks in any format that `verify`
reads. `judge` recognises the agents in tracks, compares them with the label and counts.
"""
