"""A scenario as a world that obeys physics: what hangs, moves, shines and is heard at any time.

The same seed gives the same world, bit for bit: what happens at a time does not depend on what was
asked before. Robots' programs are not in it; what they may know of it is marked so in `robot.py`.
"""
