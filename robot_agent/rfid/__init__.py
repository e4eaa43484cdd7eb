"""Readers of RFID tags: what the agent asks of one, and the drivers that do it."""
