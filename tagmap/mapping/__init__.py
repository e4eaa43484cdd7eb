"""The parts of the mapper: what has arrived, what the map is, where the robots are. No I/O."""
