"""Who is lit, who hears whom, and what tag memories hold. Shared by all emulated devices.

Time is passed in, chance depends on the seed and on what is asked: the same questions have the
same answers in any order, live or in virtual time. An emulated device sees the scene through what
its antenna hears, never through the truth behind it.
"""
