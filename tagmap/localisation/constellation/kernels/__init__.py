"""Compiled search. Importing these modules imports numba: do it where they are used."""
