"""Units that speak the ASCII protocol of Directed Perception, later FLIR: the PTU-D46 and its kin.

Source: PTU-D46 User's Manual, version 2.14.0 (Directed Perception, 2006), chapter 4.
"""
