"""All devices of a robot of the world, in true time, behind the sockets and ports of real ones.

The robot's computer is this one, so its clock is this one's too.
"""
