"""A laser with two mirrors that is not there: real datagrams, tags of a scene are lit."""
