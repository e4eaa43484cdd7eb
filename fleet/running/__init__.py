"""A whole site on this machine: router, map service and one agent per robot, as real processes."""
