"""The site file: who takes part in a secured site."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from tagmap.errors import ConfigError
from tagmap.records.base import Name, RobotNumber

Days = Annotated[int, Meta(ge=1, le=3650)]
Port = Annotated[int, Meta(ge=1, le=65535)]
Address = Annotated[str, Meta(pattern=r"^[0-9A-Za-z:.-]+$")]


class _Strict(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    pass


class Certificates(_Strict, frozen=True, kw_only=True):
    valid_days: Days = 90
    renew_days: Days = 30


class Router(_Strict, frozen=True, kw_only=True):
    name: Name
    addresses: Annotated[tuple[Address, ...], Meta(min_length=1)]
    port: Port = 7447
    listen: Address = "0.0.0.0"

    @property
    def endpoint(self) -> str:
        """Where clients and the other routers connect to."""
        return _endpoint(self.addresses[0], self.port)

    @property
    def listen_endpoint(self) -> str:
        return _endpoint(self.listen, self.port)


class Robot(_Strict, frozen=True, kw_only=True):
    name: Name
    number: RobotNumber


class Site(_Strict, frozen=True, kw_only=True):
    site: Name
    certificates: Certificates = Certificates()
    routers: Annotated[tuple[Router, ...], Meta(min_length=1)]
    robots: tuple[Robot, ...] = ()


def read_site(path: Path) -> Site:
    """ConfigError names the file, the key path, and what was expected."""
    try:
        site = msgspec.toml.decode(path.read_bytes(), type=Site)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from None
    _check_unique(path, "routers name", (router.name for router in site.routers))
    _check_unique(path, "robots name", (robot.name for robot in site.robots))
    _check_unique(path, "robots number", (robot.number for robot in site.robots))
    if site.certificates.renew_days >= site.certificates.valid_days:
        raise ConfigError(f"{path}: certificates.renew_days must be less than valid_days")
    return site


def _check_unique(path: Path, what: str, values: Iterable[str | int]) -> None:
    seen: set[str | int] = set()
    for value in values:
        if value in seen:
            raise ConfigError(f"{path}: {what} {value!r} is used twice")
        seen.add(value)


def _endpoint(host: str, port: int) -> str:
    return f"tls/[{host}]:{port}" if ":" in host else f"tls/{host}:{port}"
