"""The laser scanner: mirror angles to a beam and back, and what mirrors and drives can do."""
