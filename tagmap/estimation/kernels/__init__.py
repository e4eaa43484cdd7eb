"""Compiled parts of the joint problem."""
