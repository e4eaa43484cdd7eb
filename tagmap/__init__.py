"""Absolute positioning of indoor robots from laser-activated RFID tags: the map and its service."""

__version__ = "0.1.0"
