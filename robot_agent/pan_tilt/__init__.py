"""Where the cameras look: the unit that turns them, its angles in time, where to look next."""
