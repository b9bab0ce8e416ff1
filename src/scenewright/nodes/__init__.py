"""The five stages of the paper and the gate, as LangGraph nodes.

A node is `(state: WhatItReads, *, runtime) -> WhatItWrites`: it never routes and never mutates.
"""
