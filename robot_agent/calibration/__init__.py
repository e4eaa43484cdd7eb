"""Calibration: what a robot must know of its own sensors before it can measure."""
