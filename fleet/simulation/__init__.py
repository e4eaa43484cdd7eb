"""Made-up buildings, tags and robots, measured with the forward models the product fits."""
