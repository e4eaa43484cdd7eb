"""Recorded data of others, read as what our robots would have measured."""
