"""Many robots upon the real service at once: what it takes, and where it breaks."""
