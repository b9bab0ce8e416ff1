"""The solver (paper 3.3, Eq. 4): start times, stops and candidates that meet every clause."""
