"""Zenoh settings of clients and routers, as the dictionaries its configuration is made of.

Shared memory is off: its watchdog drops messages silently under load. Scouting is off: who talks
to whom is written down. A lease of 3 s makes a silent partition visible in 3 s.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

from tagmap.records.codec import MAX_BYTES

Settings: TypeAlias = dict[str, Any]

LEASE_MS = 3000
MAX_REPLY_BYTES = 16 * 1024 * 1024
CONNECT_ATTEMPT_MS = 1000

NO_SCOUTING: Settings = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}
RETRY: Settings = {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2}


def client_settings(endpoints: Sequence[str]) -> Settings:
    """A client of the routers at `endpoints`; it uses one and falls over to the next."""
    return {
        "mode": "client",
        "connect": {
            "endpoints": list(endpoints),
            "timeout_ms": CONNECT_ATTEMPT_MS,
            "exit_on_failure": True,
            "retry": RETRY,
        },
        "listen": {"endpoints": []},
        "scouting": NO_SCOUTING,
        "transport": _transport(),
    }


def router_settings(listen: Sequence[str], connect: Sequence[str] = ()) -> Settings:
    """A router that listens at `listen` and keeps trying the routers at `connect`."""
    transport = _transport()
    transport["unicast"] = {"max_sessions": 5000, "accept_pending": 200}
    return {
        "mode": "router",
        "listen": {"endpoints": list(listen), "exit_on_failure": True},
        "connect": {
            "endpoints": list(connect),
            "timeout_ms": 0,
            "exit_on_failure": False,
            "retry": RETRY,
        },
        "scouting": {"delay": 0, **NO_SCOUTING},
        "transport": transport,
        "low_pass_filter": [_size_limit("keyframes", ["put"], ["tagmap/*/agents/**"])],
    }


def _transport() -> Settings:
    return {
        "shared_memory": {"enabled": False},
        "link": {"tx": _transmission(), "rx": {"max_message_size": MAX_REPLY_BYTES}},
    }


def _transmission() -> Settings:
    """One stalled receiver must not stall a sender for the 5 s that are the default: 0.2 s."""
    return {
        "lease": LEASE_MS,
        "queue": {"congestion_control": {"block": {"wait_before_close": 200_000}}},
    }


def _size_limit(name: str, messages: list[str], key_exprs: list[str]) -> Settings:
    return {
        "id": name,
        "flows": ["ingress"],
        "messages": messages,
        "key_exprs": key_exprs,
        "size_limit": MAX_BYTES,
    }
