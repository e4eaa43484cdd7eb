"""A robot's devices straight on the world, in virtual time: what the agent sees of real ones."""
