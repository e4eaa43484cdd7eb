"""The fleet harness: runs agents and service on simulated and recorded data, and measures them."""
