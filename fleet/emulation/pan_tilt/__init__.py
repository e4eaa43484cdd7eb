"""A pan-tilt unit that is not there, on a pseudo terminal: the PTU-D46's protocol and motion."""
