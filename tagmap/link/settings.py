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


# A stalled receiver stalls its sender for 0.2 s, then is cut off; the default is 5 s.
_QUICK_CUT: Settings = {"block": {"wait_before_close": 200_000}}
# A client waits 10 ms, not 1 ms, for room before it drops: bursts of an outbox then get through.
_PATIENT_DROP: Settings = {"drop": {"wait_before_drop": 10_000}, **_QUICK_CUT}

# Records are no larger; what is larger stops at the router, not in the service's memory.
# Only admin questions may be: they carry surveys and maps.
_SIZE_LIMIT: Settings = {
    "id": "record-size",
    "flows": ["ingress"],
    "messages": ["put", "query"],
    "key_exprs": ["tagmap/*/agents/**", "tagmap/*/localize", "tagmap/*/activation/**"],
    "size_limit": MAX_BYTES,
}


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
        "transport": _transport(_PATIENT_DROP),
    }


def router_settings(listen: Sequence[str], connect: Sequence[str] = ()) -> Settings:
    """A router that listens at `listen` and keeps trying the routers at `connect`."""
    transport = _transport(_QUICK_CUT)
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
        "low_pass_filter": [_SIZE_LIMIT],
    }


def _transport(congestion: Settings) -> Settings:
    return {
        "shared_memory": {"enabled": False},
        "link": {
            "tx": {"lease": LEASE_MS, "queue": {"congestion_control": congestion}},
            "rx": {"max_message_size": MAX_REPLY_BYTES},
        },
    }
