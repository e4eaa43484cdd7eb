"""Which tag gets which record from which robot: decisions without I/O."""
