"""An LLRP reader for one client at a time, over the antenna of a scene."""
