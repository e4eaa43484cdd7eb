"""Which tag each spot is: what has been known a moment ago, what the pose says, what light says."""
