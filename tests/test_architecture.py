"""The house rules that can be read off the source: who imports whom, and what importing costs.

The rules are those of the architecture page; imports inside functions count as well.
"""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("tagmap", "robot_agent", "fleet")

FACTS = {"tagmap", "tagmap.conventions", "tagmap.errors"}
"""What every room may import; `tagmap` itself holds the version only."""

MAY_IMPORT: dict[str, set[str]] = {
    "geometry": set(),
    "records": {"geometry"},
    "memory": {"records"},
    "arbitration": set(),
    "writeback": {"records", "memory"},
    "localisation": {"geometry", "records"},
    "estimation": {"geometry", "records"},
    "living": {"geometry", "records", "estimation"},
    "mapping": {"geometry", "records", "localisation", "estimation", "arbitration"},
    "mapper": {"geometry", "records", "localisation", "estimation", "arbitration", "mapping"},
    "store": {"records"},
    "link": {"records"},
    "exchange": {"geometry", "records", "localisation", "estimation", "mapping"},
}
"""Rooms of tagmap below the shells. A room that is not listed may import any."""

ONLY_IN = {
    "zenoh": ("tagmap/link/",),
    "sqlite3": ("tagmap/store/",),
    # The benchmark's peer is the library itself, used as its manual says.
    "sqlite_utils": ("tagmap/store/", "fleet/benchmarks/store_peer.py"),
}

PURE = (
    "tagmap/geometry/",
    "tagmap/localisation/",
    "tagmap/estimation/",
    "tagmap/living/",
    "tagmap/mapping/",
    "tagmap/memory/",
    "tagmap/arbitration/",
    "tagmap/writeback/",
)
PURE_FILES = ("tagmap/mapper.py", "robot_agent/courier.py")
"""Decision logic: time, randomness and bytes are arguments."""
IMPURE = {"logging", "structlog", "socket", "subprocess", "threading", "time", "random", "click"}

HEAVY = ("zenoh", "numpy", "scipy", "numba", "cv2", "sqlite_utils", "matplotlib", "rich")


def sources(*packages: str) -> list[Path]:
    return sorted(path for package in packages for path in (ROOT / package).rglob("*.py"))


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imports(path: Path) -> Iterator[tuple[str, int]]:
    """Every imported module as an absolute name, with its line."""
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{relative(path)}:{node.lineno}: relative import"
            assert node.module is not None
            yield node.module, node.lineno
            # `from tagmap import link` imports a room as much as `import tagmap.link` does.
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


def room_of(module: str) -> str | None:
    """The room of tagmap that a module belongs to."""
    parts = module.split(".")
    return parts[1] if parts[0] == "tagmap" and len(parts) > 1 else None


def is_module(name: str) -> bool:
    path = ROOT.joinpath(*name.split("."))
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def our_imports(path: Path) -> Iterator[tuple[str, int]]:
    """Imports of modules of this project: names imported from them are left out."""
    for module, line in imports(path):
        if module.split(".")[0] in PACKAGES and is_module(module):
            yield module, line


def violations(found: Iterator[str]) -> None:
    assert sorted(set(found)) == []


def test_packages_import_one_way() -> None:
    below = {"tagmap": {"tagmap"}, "robot_agent": {"tagmap", "robot_agent"}, "fleet": set(PACKAGES)}

    def found() -> Iterator[str]:
        for package in PACKAGES:
            for path in sources(package):
                for module, line in imports(path):
                    owner = module.split(".")[0]
                    if owner in PACKAGES and owner not in below[package]:
                        yield f"{relative(path)}:{line} imports {module}"

    violations(found())


def test_rooms_of_tagmap_import_one_way() -> None:
    def found() -> Iterator[str]:
        for path in sources("tagmap"):
            own = room_of(".".join(path.relative_to(ROOT).with_suffix("").parts))
            if own not in MAY_IMPORT:
                continue
            for module, line in our_imports(path):
                other = room_of(module)
                if module not in FACTS and other != own and other not in MAY_IMPORT[own]:
                    yield f"{relative(path)}:{line} imports {module}"

    violations(found())


@pytest.mark.parametrize("library", sorted(ONLY_IN))
def test_only_one_room_knows(library: str) -> None:
    def found() -> Iterator[str]:
        for path in sources(*PACKAGES):
            if relative(path).startswith(ONLY_IN[library]):
                continue
            for module, line in imports(path):
                if module.split(".")[0] == library:
                    yield f"{relative(path)}:{line} imports {module}"

    violations(found())


def test_decision_logic_is_pure() -> None:
    def found() -> Iterator[str]:
        for path in sources("tagmap", "robot_agent"):
            name = relative(path)
            if name.startswith(PURE) or name in PURE_FILES:
                for module, line in imports(path):
                    if module.split(".")[0] in IMPURE:
                        yield f"{name}:{line} imports {module}"

    violations(found())


def test_truth_has_one_reader() -> None:
    """Nothing that estimates may see what evaluation compares with."""

    def found() -> Iterator[str]:
        for path in sources("tagmap", "robot_agent"):
            for module, line in imports(path):
                if "truth" in module.lower():
                    yield f"{relative(path)}:{line} imports {module}"

    violations(found())


@pytest.mark.parametrize("package", [*PACKAGES, *(f"{name}.cli" for name in PACKAGES)])
def test_importing_a_program_is_light(package: str) -> None:
    """`tagmap --help` must not wait for what only some commands need."""
    assert loaded_by(package) & set(HEAVY) == set()


@pytest.mark.parametrize("room", ["tagmap.link", "tagmap.store", "tagmap.records"])
def test_importing_a_room_is_light(room: str) -> None:
    assert loaded_by(room) & (set(HEAVY) - {"numpy", "sqlite_utils"}) == set()


def loaded_by(module: str) -> set[str]:
    program = f"import {module}, sys; print(*sys.modules)"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_every_module_writes_nothing(package: str, tmp_path: Path) -> None:
    """Importing does nothing: no file, no output, no thread."""
    modules = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for path in sources(package)
        if path.stem != "__main__"
    ]
    program = f"""
import importlib, threading
for name in {modules!r}:
    importlib.import_module(name)
print(threading.active_count())
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "1\n"
    assert list(tmp_path.iterdir()) == []
