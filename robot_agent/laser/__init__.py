"""The laser and its mirrors: what is asked of them, their drivers, and the interlock."""
