"""The generator: what it writes, what it keeps, and what it says when it cannot."""

import stat
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from cryptography import x509

if TYPE_CHECKING:
    from tests.deploy.conftest import Generate, SecuredSite

MakeSite = Callable[..., "SecuredSite"]
EXAMPLE = Path(__file__).parents[2] / "deploy" / "site.toml"


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def certificate(folder: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate((folder / "tls.crt").read_bytes())


def changed(before: dict[str, bytes], after: dict[str, bytes]) -> set[str]:
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}


def test_the_example_is_complete(generate: "Generate", tmp_path: Path) -> None:
    done = generate(EXAMPLE, tmp_path / "out")
    assert done.returncode == 0, done.stderr
    folders = {str(Path(name).parent) for name in contents(tmp_path / "out")}
    people = {"service", "admin", "routers/router-a", "robots/r1", "robots/r2"}
    assert folders == {"authority", *people}
    for folder in people:
        names = {path.name for path in (tmp_path / "out" / folder).iterdir()}
        assert names == {"ca.crt", "tls.crt", "tls.key", "zenoh.json5"}


def test_keys_are_for_their_owner_only(make_site: MakeSite, tmp_path: Path) -> None:
    site = make_site(tmp_path, 7447, "r1")
    keys = list(site.folder.rglob("*.key"))
    assert len(keys) == 5
    for key in keys:
        assert stat.S_IMODE(key.stat().st_mode) == 0o600
        assert stat.S_IMODE(key.parent.stat().st_mode) == 0o700


def test_running_again_changes_nothing(make_site: MakeSite, tmp_path: Path) -> None:
    before = contents(make_site(tmp_path, 7447, "r1", "r2").folder)
    assert contents(make_site(tmp_path, 7447, "r1", "r2").folder) == before


def test_adding_a_robot_touches_only_its_folder_and_the_rules(
    make_site: MakeSite, tmp_path: Path
) -> None:
    before = contents(make_site(tmp_path, 7447, "r1").folder)
    after = contents(make_site(tmp_path, 7447, "r1", "r2").folder)
    files = ("ca.crt", "tls.crt", "tls.key", "zenoh.json5")
    assert changed(before, after) == {
        "routers/router-a/zenoh.json5",
        *(f"robots/r2/{file}" for file in files),
    }


def test_a_robot_that_comes_back_is_somebody_else(make_site: MakeSite, tmp_path: Path) -> None:
    """Or else whoever kept the old key would be let in again."""
    site = make_site(tmp_path, 7447, "r1", "r2")
    old = certificate(site.folder / "robots/r2")
    make_site(tmp_path, 7447, "r1")
    assert not list((site.folder / "robots/r2").iterdir())
    make_site(tmp_path, 7447, "r1", "r2")
    assert certificate(site.folder / "robots/r2").subject != old.subject


def test_renewing_replaces_certificates_only(make_site: MakeSite, tmp_path: Path) -> None:
    site = make_site(tmp_path, 7447, "r1")
    before, old = contents(site.folder), certificate(site.folder / "robots/r1")
    make_site(tmp_path, 7447, "r1", options=("--renew",))
    renewed = {name for name in before if name.endswith("tls.crt")}
    assert changed(before, contents(site.folder)) == renewed
    new = certificate(site.folder / "robots/r1")
    assert new.subject == old.subject
    assert new.serial_number != old.serial_number


def test_reissuing_makes_a_new_key_and_identity(make_site: MakeSite, tmp_path: Path) -> None:
    site = make_site(tmp_path, 7447, "r1", "r2")
    before, old = contents(site.folder), certificate(site.folder / "robots/r1")
    make_site(tmp_path, 7447, "r1", "r2", options=("--reissue", "robots/r1"))
    new = certificate(site.folder / "robots/r1")
    assert (new.subject, new.public_key()) != (old.subject, old.public_key())
    assert changed(before, contents(site.folder)) == {
        "robots/r1/tls.crt",
        "robots/r1/tls.key",
        "routers/router-a/zenoh.json5",
    }


def test_a_certificate_of_a_lost_key_is_replaced(make_site: MakeSite, tmp_path: Path) -> None:
    site = make_site(tmp_path, 7447, "r1")
    robot, service = site.folder / "robots/r1", site.folder / "service"
    (robot / "tls.key").write_bytes((service / "tls.key").read_bytes())
    make_site(tmp_path, 7447, "r1")
    assert certificate(robot).public_key() == certificate(service).public_key()


def test_changed_addresses_go_into_the_routers_certificate(
    generate: "Generate", tmp_path: Path
) -> None:
    site_file, out = tmp_path / "site.toml", tmp_path / "out"
    for address in ("10.0.0.1", "router.example", "fd00::1"):
        site_file.write_text(f'site = "hall"\n[[routers]]\nname = "a"\naddresses = ["{address}"]\n')
        assert generate(site_file, out).returncode == 0
    names = certificate(out / "routers/a").extensions.get_extension_for_class(
        x509.SubjectAlternativeName
    )
    assert [str(name.value) for name in names.value] == ["fd00::1"]
    assert '"tls/[fd00::1]:7447"' in (out / "service/zenoh.json5").read_text()


ROUTER = '[[routers]]\nname = "a"\naddresses = ["10.0.0.1"]\n'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("site = ", "site.toml: "),
        ('site = "hall"', "site.toml: Object missing required field `routers`"),
        ('site = "hall"\nrouters = []', "length >= 1 - at `$.routers`"),
        (f'site = "Hall"\n{ROUTER}', "at `$.site`"),
        (f'site = "hall"\nsurprise = 1\n{ROUTER}', "unknown field `surprise`"),
        (f'site = "hall"\n{ROUTER}{ROUTER}', "routers name 'a' is used twice"),
        (f'site = "hall"\n{ROUTER}port = 70000', "<= 65535 - at `$.routers[0].port`"),
        (
            f'site = "hall"\n{ROUTER}[[robots]]\nname = "r1"\nnumber = 0',
            ">= 1 - at `$.robots[0].number`",
        ),
        (
            f'site = "hall"\n{ROUTER}[[robots]]\nname = "r1"\nnumber = 1\n'
            '[[robots]]\nname = "r2"\nnumber = 1',
            "robots number 1 is used twice",
        ),
        (
            f'site = "hall"\n[certificates]\nvalid_days = 10\n{ROUTER}',
            "renew_days must be less than valid_days",
        ),
    ],
)
def test_site_files_that_are_not_acceptable(
    generate: "Generate", tmp_path: Path, text: str, expected: str
) -> None:
    site_file = tmp_path / "site.toml"
    site_file.write_text(text)
    refused(generate(site_file, tmp_path / "out"), expected)
    assert not (tmp_path / "out").exists()


def refused(done: Any, expected: str) -> None:
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert expected in done.stderr
    assert done.stderr.count("\n") == 1


def test_folders_that_are_not_acceptable(
    make_site: MakeSite, generate: "Generate", tmp_path: Path
) -> None:
    refused(generate(tmp_path / "no.toml", tmp_path / "out"), "no.toml: cannot be read")
    site = make_site(tmp_path, 7447, "r1")
    site_file = tmp_path / "hall.toml"
    refused(generate(site_file, site_file), "hall.toml")
    refused(
        generate(site_file, site.folder, "--reissue", "robots/r9"),
        "--reissue robots/r9: no such participant",
    )
    site_file.write_text(site_file.read_text().replace("hall", "other"))
    refused(generate(site_file, site.folder), "is the authority of 'tagmap hall'")
    (site.folder / "authority/ca.crt").write_text("junk")
    refused(generate(site_file, site.folder), "ca.crt: not a PEM certificate")
    (site.folder / "authority/ca.crt").unlink()
    refused(generate(site_file, site.folder), "ca.crt: cannot be read")
