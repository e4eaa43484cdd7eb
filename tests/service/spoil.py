"""Ways in which bytes go bad between a robot and the service."""

import struct


def spoilt(payload, rng):
    return rng.choice(WAYS)(bytearray(payload), rng)


def flipped(data, rng):
    for _ in range(rng.randint(1, 4)):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(data)


def cut(data, rng):
    return bytes(data[: rng.randrange(len(data))])


def doubled(data, rng):
    start = rng.randrange(len(data))
    return bytes(data[: start + rng.randrange(40)] + data[start:])


def overwritten(data, rng):
    """With numbers that are none, or huge."""
    value = rng.choice([float("nan"), float("inf"), 1e308, -0.0])
    start = rng.randrange(len(data))
    data[start : start + 9] = b"\xcb" + struct.pack(">d", value)
    return bytes(data)


def versioned(data, rng):
    """Messages begin with their version."""
    return bytes(data).replace(b"\xa1v\x01", b"\xa1v" + bytes([rng.randrange(2, 100)]), 1)


def nested(_data, rng):
    return bytes([rng.choice([0x91, 0x81])]) * rng.randrange(1, 5000)


def noise(_data, rng):
    return rng.randbytes(rng.randrange(300))


WAYS = [flipped, flipped, cut, doubled, overwritten, versioned, nested, noise]
