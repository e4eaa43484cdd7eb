"""The shell around the mapper: Zenoh, the database, clocks and processes."""
