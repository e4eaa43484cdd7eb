"""How the robot drove: poses dead-reckoned by its wheels, whether it stands, and how far to trust
them."""
