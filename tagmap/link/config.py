"""From settings or a file to a zenoh.Config that this product can rely on."""

import json
from collections.abc import Sequence
from pathlib import Path

import zenoh

from tagmap.errors import LinkError
from tagmap.link.settings import (
    CONNECT_ATTEMPT_MS,
    NO_SCOUTING,
    Settings,
    client_settings,
    router_settings,
)

TLS = "transport/link/tls"


def client_config(endpoints: Sequence[str], file: Path | None) -> zenoh.Config:
    """A client's configuration: `endpoints`, or `file`, or `file` with other endpoints."""
    if file is None:
        return _from_settings(client_settings(endpoints))
    config = _from_file(file, mode="client")
    if endpoints:
        config.insert_json5("connect/endpoints", json.dumps(list(endpoints)))
    if not endpoints_of(config):
        raise LinkError(f"{file}: connect/endpoints is empty, expected at least one router")
    config.insert_json5("connect/timeout_ms", str(CONNECT_ATTEMPT_MS))
    config.insert_json5("connect/exit_on_failure", "true")
    config.insert_json5("scouting/multicast/enabled", json.dumps(False))
    config.insert_json5("scouting/gossip/enabled", json.dumps(NO_SCOUTING["gossip"]["enabled"]))
    return config


def router_config(listen: Sequence[str], file: Path | None) -> zenoh.Config:
    """A router's configuration: the plain one at `listen`, or `file`."""
    if file is None:
        return _from_settings(router_settings(listen))
    return _from_file(file, mode="router")


def endpoints_of(config: zenoh.Config, role: str = "connect") -> list[str]:
    """The endpoints a client connects to, or a router listens at (`role` = listen)."""
    endpoints = json.loads(config.get_json(f"{role}/endpoints"))
    if isinstance(endpoints, dict):
        endpoints = endpoints.get("router" if role == "listen" else "client") or []
    return [str(endpoint) for endpoint in endpoints or []]


def tls_of(config: zenoh.Config) -> Settings:
    return json.loads(config.get_json(TLS)) or {}


def _from_settings(settings: Settings) -> zenoh.Config:
    try:
        return zenoh.Config.from_json5(json.dumps(settings))
    except zenoh.ZError as error:
        raise LinkError(f"not a usable endpoint: {one_line(error)}") from None


def _from_file(file: Path, mode: str) -> zenoh.Config:
    try:
        config = zenoh.Config.from_file(file)
    except zenoh.ZError as error:
        raise LinkError(f"{file}: not a Zenoh configuration: {one_line(error)}") from None
    found = json.loads(config.get_json("mode"))
    if found not in (None, mode):
        raise LinkError(f"{file}: mode is {found!r}, expected {mode!r}")
    config.insert_json5("mode", json.dumps(mode))
    config.insert_json5("transport/shared_memory/enabled", "false")
    _resolve_files(config, file.resolve().parent)
    return config


def _resolve_files(config: zenoh.Config, folder: Path) -> None:
    """Certificates named relatively lie beside the file that names them, wherever we run."""
    for name, value in tls_of(config).items():
        if name.endswith(("_certificate", "_private_key")) and value:
            config.insert_json5(f"{TLS}/{name}", json.dumps(str(folder / value)))


def one_line(error: zenoh.ZError) -> str:
    """Zenoh's message without the source positions it appends."""
    return " ".join(str(error).split(" at /")[0].split())
