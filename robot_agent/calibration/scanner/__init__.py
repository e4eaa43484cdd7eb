"""Calibrating the laser scanner: from samples of beams that met targets to where it aims."""
