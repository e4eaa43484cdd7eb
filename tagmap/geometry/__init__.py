"""Forward models, each exactly once: rigid motions, cameras, stereo, measurements, alignment."""
