"""How far a map and its poses are from the truth. The only reader of truth."""
