"""Who is let in by a secured router, who is not, and how certificates end and are replaced."""

import shutil
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization

from tagmap.errors import LinkError
from tagmap.link.config import client_config, endpoints_of
from tagmap.link.keys import Keys
from tagmap.link.router import RouterProcess
from tagmap.link.session import Link

if TYPE_CHECKING:
    from tests.deploy.conftest import SecuredSite

MakeSite: TypeAlias = Callable[..., "SecuredSite"]
Eventually: TypeAlias = Callable[[Callable[[], object]], None]


def refusal(site: "SecuredSite", config: Path) -> str:
    with pytest.raises(LinkError) as caught:
        Link.open([site.endpoint], zenoh_config=config)
    message = str(caught.value)
    assert message.startswith(f"no router at {site.endpoint}: ")
    assert "\n" not in message
    return message


def copy_of(site: "SecuredSite", participant: str, folder: Path) -> Path:
    """A participant's folder, to be spoilt."""
    shutil.copytree(site.folder / participant, folder / "copy")
    return folder / "copy"


def reissue(folder: Path, authority: Path, lifetime: timedelta) -> None:
    """The same certificate, but valid until `lifetime` from now."""
    key_pem = (authority / "ca.key").read_bytes()
    key = serialization.load_pem_private_key(key_pem, password=None)
    old = x509.load_pem_x509_certificate((folder / "tls.crt").read_bytes())
    now = datetime.now(UTC)
    fresh = x509.CertificateBuilder(
        issuer_name=old.issuer,
        subject_name=old.subject,
        public_key=old.public_key(),
        serial_number=x509.random_serial_number(),
        not_valid_before=now - timedelta(days=2),
        not_valid_after=now + lifetime,
        extensions=list(old.extensions),
    ).sign(key, hashes.SHA256())  # type: ignore[arg-type]
    (folder / "tls.crt").write_bytes(fresh.public_bytes(serialization.Encoding.PEM))


def test_everybody_of_the_site_is_let_in(secured: "SecuredSite") -> None:
    for participant in ("service", "admin", "robots/r1", "robots/r2"):
        with secured.open(participant) as link:
            assert link.connected()


def test_no_certificate(secured: "SecuredSite", endpoint: str) -> None:
    with pytest.raises(LinkError, match="wants certificates"):
        Link.open([secured.endpoint])
    with pytest.raises(LinkError, match="does it expect tls/"):
        Link.open([secured.endpoint.replace("tls/", "tcp/")])
    with pytest.raises(LinkError, match="Connection refused"):
        Link.open([endpoint.replace("tcp/", "tls/")])


def test_another_sites_certificate(
    secured: "SecuredSite", make_site: MakeSite, tmp_path: Path
) -> None:
    foreign = make_site(tmp_path, 7447, "r1", site="other").folder / "robots/r1"
    message = refusal(secured, foreign / "zenoh.json5")
    assert "its certificate is not accepted: unable to get local issuer" in message
    shutil.copy(secured.folder / "robots/r1/ca.crt", foreign / "ca.crt")
    assert "it refuses our certificate" in refusal(secured, foreign / "zenoh.json5")


def test_expired_certificate(secured: "SecuredSite", tmp_path: Path) -> None:
    folder = copy_of(secured, "robots/r1", tmp_path)
    reissue(folder, secured.folder / "authority", timedelta(days=-1))
    message = refusal(secured, folder / "zenoh.json5")
    assert "it refuses our certificate" in message
    assert "expired" in message


def test_missing_key(secured: "SecuredSite", tmp_path: Path) -> None:
    folder = copy_of(secured, "robots/r1", tmp_path)
    (folder / "tls.key").unlink()
    assert "tls.key: no such file" in refusal(secured, folder / "zenoh.json5")


def test_key_of_somebody_else(secured: "SecuredSite", tmp_path: Path) -> None:
    folder = copy_of(secured, "robots/r1", tmp_path)
    shutil.copy(secured.folder / "robots/r2/tls.key", folder)
    assert "with its key is not usable" in refusal(secured, folder / "zenoh.json5")


def test_router_under_another_name(secured: "SecuredSite") -> None:
    """Its certificate is for 127.0.0.1 only; whoever answers at another name is not it."""
    elsewhere = secured.endpoint.replace("127.0.0.1", "localhost")
    with pytest.raises(LinkError, match="not accepted: Hostname mismatch"):
        Link.open([elsewhere], zenoh_config=secured.config("robots/r1"))


def test_a_renewed_certificate_is_taken_up_without_a_restart(
    secured: "SecuredSite", tmp_path: Path, eventually: Eventually
) -> None:
    folder = copy_of(secured, "robots/r1", tmp_path)
    reissue(folder, secured.folder / "authority", timedelta(seconds=4))
    connections: list[float] = []
    config = folder / "zenoh.json5"
    with Link.open(zenoh_config=config, wait_s=3.0) as link, secured.open("service") as service:
        link.on_connected(lambda: connections.append(time.monotonic()))
        service.serve(secured.keys.ack(), lambda query: query.reply(query.key, b"ack"))
        assert link.ask(secured.keys.ack("r1"))
        eventually(lambda: not link.connected())
        shutil.copy(secured.folder / "robots/r1/tls.crt", folder)
        eventually(link.connected)
        assert link.ask(secured.keys.ack("r1"), timeout_s=20.0)
        eventually(lambda: len(connections) == 2)


def test_a_removed_robot_has_no_rights_left(
    make_site: MakeSite, tmp_path: Path, free_port: int, eventually: Eventually
) -> None:
    """Its certificate still opens a session, in which nothing is allowed."""
    site = make_site(tmp_path, free_port, "r1", "r2")
    stolen = copy_of(site, "robots/r2", tmp_path)
    make_site(tmp_path, free_port, "r1")
    make_site(tmp_path, free_port, "r1", "r2")  # a successor of the same name
    heard: list[tuple[str, bytes]] = []
    with (
        site.router(),
        site.open("service") as service,
        site.open("robots/r2") as successor,
        Link.open(zenoh_config=stolen / "zenoh.json5", wait_s=10.0) as thief,
    ):
        service.subscribe(site.keys.keyframes(), lambda *sample: heard.append(sample))
        service.serve(site.keys.ack(), lambda query: query.reply(query.key, b"ack"))
        assert successor.ask(site.keys.ack("r2"))

        def heard_successor() -> bool:
            thief.put(site.keys.keyframes("r2"), b"thief")
            successor.put(site.keys.keyframes("r2"), b"successor")
            return (site.keys.keyframes("r2"), b"successor") in heard

        eventually(heard_successor)
        assert thief.get(site.keys.ack("r2")) == []
        assert thief.get(site.keys.map_tags()) == []
    assert {payload for _, payload in heard} == {b"successor"}


def test_two_secured_routers_pass_on_and_stand_in_for_each_other(
    tmp_path: Path,
    new_port: Callable[[], int],
    generate: Callable[..., object],
    eventually: Eventually,
) -> None:
    entries = [
        f'[[routers]]\nname = "{name}"\naddresses = ["127.0.0.1"]\nport = {new_port()}\n'
        for name in "ab"
    ]
    robots = '[[robots]]\nname = "r1"\nnumber = 1\n'
    site_file, out, keys = tmp_path / "site.toml", tmp_path / "out", Keys("hall")
    site_file.write_text('site = "hall"\n' + "".join(entries) + robots)
    generate(site_file, out)
    endpoints = endpoints_of(client_config([], out / "service/zenoh.json5"))
    heard: list[tuple[str, bytes]] = []
    a, b = (RouterProcess(config=out / f"routers/{name}/zenoh.json5") for name in "ab")
    with a, b:
        agent_config, service_config = out / "robots/r1/zenoh.json5", out / "service/zenoh.json5"
        with (
            Link.open(endpoints[:1], zenoh_config=agent_config, wait_s=10.0) as agent,
            Link.open(endpoints[1:], zenoh_config=service_config, wait_s=10.0) as service,
            Link.open(endpoints, zenoh_config=agent_config, wait_s=10.0) as roaming,
        ):
            service.subscribe(keys.keyframes(), lambda *sample: heard.append(sample))
            service.serve(keys.ack(), lambda query: query.reply(query.key, b"ack"))

            def both_heard() -> bool:
                agent.put(keys.keyframes("r1"), b"across")
                agent.put(keys.keyframes("r2"), b"forged")
                return bool(heard)

            eventually(both_heard)
            assert agent.ask(keys.ack("r1"), timeout_s=20.0)[0].payload == b"ack"
            a.stop()
            eventually(lambda: roaming.get(keys.ack("r1")))
    assert {payload for _, payload in heard} == {b"across"}
