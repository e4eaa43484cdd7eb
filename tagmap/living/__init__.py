"""The map that lives on: a joint problem that is fed for ever and stays as large as its map.

Alive are the latest keyframes of each robot; all that came before is condensed into a Gaussian on
the tags (tagmap.estimation.condensed). `Living` is fed with records and answers with a `Solution`.
No I/O.
"""
