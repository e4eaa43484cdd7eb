"""Chance that depends on what is asked, not on how often or in which order."""

from hashlib import blake2b


def bits(seed: int, *what: str | int) -> int:
    """64 random bits, the same for the same words."""
    key = "\x1f".join(map(str, (seed, *what)))
    return int.from_bytes(blake2b(key.encode(), digest_size=8).digest())


def happens(probability: float, seed: int, *what: str | int) -> bool:
    return probability > 0.0 and bits(seed, *what) < probability * 2.0**64
