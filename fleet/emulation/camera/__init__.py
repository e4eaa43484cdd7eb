"""Cameras that are not there, served over TCP as the agent's network driver asks for them."""
