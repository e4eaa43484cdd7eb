"""The map that lives on: a joint problem that is fed for ever and stays as large as its map. No I/O.

Alive are the latest keyframes of each robot; all that came before is condensed into a Gaussian on
the tags (tagmap.estimation.lifelong). `Living` is fed with records and answers with a `Solution`.
"""
