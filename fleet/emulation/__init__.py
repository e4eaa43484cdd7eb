"""Devices that are not there, speaking their real protocols; what they sense is a scene."""
