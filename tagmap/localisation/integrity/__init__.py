"""What a pose promises when tags may be wrong: hypotheses, exclusion, protection level."""
