"""Pose from identified tags: one-shot fixes, and the live pose of a robot."""
