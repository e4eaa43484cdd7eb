"""A scenario in true time: the real programs as processes, around an emulated world."""
