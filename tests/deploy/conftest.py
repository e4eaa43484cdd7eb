"""A secured site on loopback: certificates and rules from the generator, a real TLS router."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import pytest

from tagmap.link.keys import Keys
from tagmap.link.router import RouterProcess
from tagmap.link.session import Link

GENERATOR = Path(__file__).parents[2] / "deploy" / "make_site.py"
SITE = """
site = "{site}"
[[routers]]
name = "router-a"
addresses = ["127.0.0.1"]
listen = "127.0.0.1"
port = {port}
"""

Generate: TypeAlias = Callable[..., subprocess.CompletedProcess[str]]


@dataclass(frozen=True)
class SecuredSite:
    folder: Path
    keys: Keys
    endpoint: str

    def config(self, participant: str) -> Path:
        return self.folder / participant / "zenoh.json5"

    def open(self, participant: str) -> Link:
        return Link.open(zenoh_config=self.config(participant), wait_s=10.0)

    def router(self) -> RouterProcess:
        return RouterProcess(config=self.config("routers/router-a"))


@pytest.fixture(scope="session")
def generate() -> Generate:
    """`generate(site_file, out, *options)`: run the generator as an operator does."""

    def run(site_file: Path, out: Path, *options: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, str(GENERATOR), str(site_file), "--out", str(out), *options]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    return run


@pytest.fixture(scope="session")
def make_site(generate: Generate) -> Callable[..., SecuredSite]:
    """`make_site(folder, port, *robots)`: the folders of a secured site, made or updated."""

    def make(
        folder: Path, port: int, *robots: str, site: str = "hall", options: tuple[str, ...] = ()
    ) -> SecuredSite:
        site_file = folder / f"{site}.toml"
        entries = [
            f'[[robots]]\nname = "{robot}"\nnumber = {number}\n'
            for number, robot in enumerate(robots, start=1)
        ]
        site_file.write_text(SITE.format(site=site, port=port) + "".join(entries))
        done = generate(site_file, folder / site, *options)
        assert done.returncode == 0, done.stderr
        return SecuredSite(folder / site, Keys(site), f"tls/127.0.0.1:{port}")

    return make


@pytest.fixture(scope="module")
def secured(
    make_site: Callable[..., SecuredSite],
    new_port: Callable[[], int],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[SecuredSite]:
    """A generated site of r1 and r2 with its router running."""
    site = make_site(tmp_path_factory.mktemp("secured"), new_port(), "r1", "r2")
    with site.router():
        yield site
