"""Pairs of images with the time of their exposure: from recorded folders, from OpenCV."""
