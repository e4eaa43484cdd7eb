"""What a simulated world is made of, as a TOML file: described here, built in the room `world`."""
