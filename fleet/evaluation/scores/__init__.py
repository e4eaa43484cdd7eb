"""What a run of a scenario is worth, by truth: one number for everything that was promised."""
