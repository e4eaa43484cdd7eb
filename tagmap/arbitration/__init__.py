"""Who may shoot: leases from the service, and what a robot does without it. No I/O, no clock."""
