"""A whole site in one process and in virtual time: the same service and agents, real files."""
