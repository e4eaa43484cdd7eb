"""The devices of one robot: how they are configured, opened and checked."""
