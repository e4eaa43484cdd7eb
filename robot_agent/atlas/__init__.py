"""Where tags are, as far as the robot knows: from the map, and from what the tags remember."""
