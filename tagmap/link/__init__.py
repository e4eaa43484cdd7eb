"""Everything that touches Zenoh: keys, sessions, routers. Import the files, not this page."""
