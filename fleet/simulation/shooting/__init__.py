"""Robots that shoot at the tags of one scene, in virtual time, with the agent's own code."""
