"""Make a secured site: certificates, keys, router and client configurations from one site file.

    python deploy/make_site.py site.toml --out secured

Each folder it makes goes to the machine of its name, except `authority/`, which goes nowhere.
Running it again keeps what is still right, issues what is new, renews what expires soon, and
removes who is no longer in the site file. See docs/security.md.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import click
from access_rules import Identities, access_control
from certificates import (
    Authority,
    Wanted,
    common_name,
    open_authority,
    settle_certificate,
    write,
)
from site_file import Router, Site, read_site

from tagmap.errors import ConfigError, TagmapError
from tagmap.link.keys import Keys
from tagmap.link.settings import Settings, client_settings, router_settings

FILES = ("ca.crt", "tls.crt", "tls.key", "zenoh.json5")


def participants(site: Site) -> Iterator[tuple[str, Wanted]]:
    """Folder and certificate of everyone who takes part."""
    for router in site.routers:
        yield f"routers/{router.name}", Wanted(router.name, router.addresses)
    yield "service", Wanted("service")
    yield "admin", Wanted("admin")
    for robot in site.robots:
        yield f"robots/{robot.name}", Wanted(robot.name)


def make_site(site: Site, out: Path, renew: bool, reissue: tuple[str, ...]) -> Iterator[str]:
    """Bring `out` up to date with `site`; yields what was done, line by line."""
    authority, fresh = open_authority(out / "authority", site.site)
    until = authority.certificate.not_valid_after_utc
    yield f"authority: {'made' if fresh else 'kept'}, valid until {until:%Y-%m-%d}"
    yield from _remove_folders(out, site, reissue)
    names: dict[str, str] = {}
    for folder, wanted in participants(site):
        days = site.certificates
        renew_days = days.valid_days if renew else days.renew_days
        certificate, done = settle_certificate(
            out / folder, authority, wanted, days.valid_days, renew_days
        )
        names[folder] = common_name(certificate)
        yield f"{folder}: {done}, valid until {certificate.not_valid_after_utc:%Y-%m-%d}"
    if _write_configurations(site, out, authority, names):
        yield "routers: configuration changed; copy it there and restart them one after another"


def _remove_folders(out: Path, site: Site, reissue: tuple[str, ...]) -> Iterator[str]:
    """Drop the keys of those who left the site file or get a new identity."""
    expected = {folder for folder, _ in participants(site)}
    if unknown := set(reissue) - expected:
        raise ConfigError(
            f"--reissue {min(unknown)}: no such participant, expected one of {sorted(expected)}"
        )
    present = {
        f"{kind}/{path.name}" for kind in ("routers", "robots") for path in out.glob(f"{kind}/*")
    }
    for folder in sorted((present - expected) | set(reissue)):
        files = [out / folder / file for file in FILES if (out / folder / file).exists()]
        for file in files:
            file.unlink()
        if folder not in expected and files:
            yield f"{folder}: removed; loses its rights when the routers restart"


def _write_configurations(
    site: Site, out: Path, authority: Authority, names: dict[str, str]
) -> bool:
    """Write every `zenoh.json5`; whether a router's has changed."""
    rules = access_control(Keys(site.site), _identities(site, names))
    routers = {f"routers/{router.name}": router for router in site.routers}
    changed = False
    for folder in names:
        write(out / folder / "ca.crt", authority.pem)
        if folder in routers:
            settings = _router(site, routers[folder], rules)
            changed |= write(out / folder / "zenoh.json5", _json5(_ROUTER_USE, settings))
        else:
            write(out / folder / "zenoh.json5", _json5(_use_of(site, folder), _client(site)))
    return changed


def _identities(site: Site, names: dict[str, str]) -> Identities:
    return Identities(
        routers=tuple(names[f"routers/{router.name}"] for router in site.routers),
        service=names["service"],
        admin=names["admin"],
        robots={robot.name: names[f"robots/{robot.name}"] for robot in site.robots},
    )


def _router(site: Site, router: Router, rules: Settings) -> Settings:
    others = [other.endpoint for other in site.routers if other.name != router.name]
    settings = router_settings([router.listen_endpoint], others)
    tls = {
        "listen_private_key": "tls.key",
        "listen_certificate": "tls.crt",
        "enable_mtls": True,
        **_connecting(),
    }
    settings["transport"]["link"] |= {"protocols": ["tls"], "tls": tls}
    return settings | {"access_control": rules}


def _client(site: Site) -> Settings:
    settings = client_settings([router.endpoint for router in site.routers])
    tls = {"enable_mtls": True, **_connecting()}
    settings["transport"]["link"] |= {"protocols": ["tls"], "tls": tls}
    return settings


def _connecting() -> Settings:
    return {
        "root_ca_certificate": "ca.crt",
        "connect_private_key": "tls.key",
        "connect_certificate": "tls.crt",
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }


_ROUTER_USE = "python -m tagmap.link.router --config zenoh.json5, or, in this folder, zenohd -c"


def _use_of(site: Site, folder: str) -> str:
    """The command line that goes with a client's configuration."""
    common = f"--site {site.site} --zenoh-config zenoh.json5"
    for robot in site.robots:
        if folder == f"robots/{robot.name}":
            who = f"--robot {robot.name} --number {robot.number}"
            return f"robot-agent run --config robot.toml {who} {common}"
    return f"tagmap {'serve' if folder == 'service' else 'status'} {common}"


def _json5(use: str, settings: Settings) -> bytes:
    return f"// Made by make_site.py. Use: {use}\n{json.dumps(settings, indent=2)}\n".encode()


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("site_file", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write.")
@click.option("--renew", is_flag=True, help="Renew every certificate now.")
@click.option(
    "--reissue",
    multiple=True,
    metavar="FOLDER",
    help="New key and identity, as robots/r1; the old one loses its rights. Repeatable.",
)
def main(site_file: Path, out: Path, renew: bool, reissue: tuple[str, ...]) -> None:
    try:
        for line in make_site(read_site(site_file), out, renew, reissue):
            click.echo(line)
    except TagmapError as error:
        sys.exit(f"error: {error}")
    except OSError as error:
        sys.exit(f"error: {error.filename}: {error.strerror}")


if __name__ == "__main__":
    main()
