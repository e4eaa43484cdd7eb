"""A kernel without a way in from Python must not be called from there: the process would end."""

import ast
import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

import pytest
from numba.core.dispatcher import Dispatcher

import fleet
import robot_agent
import tagmap

PACKAGES = (tagmap, robot_agent, fleet)
NAMES = tuple(package.__name__ for package in PACKAGES)


def modules() -> list[ModuleType]:
    names = [
        info.name
        for package in PACKAGES
        for info in pkgutil.walk_packages(package.__path__, package.__name__ + ".")
        if not info.name.endswith("__main__")
    ]
    return [importlib.import_module(name) for name in names]


def is_internal(value: object) -> bool:
    return isinstance(value, Dispatcher) and bool(value.targetoptions.get("no_cpython_wrapper"))


def functions(module: ModuleType) -> Iterator[FunctionType]:
    """Plain ones, of classes too, that are written in this module."""
    for value in vars(module).values():
        parts = vars(value).values() if isinstance(value, type) else (value,)
        for part in parts:
            plain = getattr(part, "__func__", getattr(part, "fget", part))
            if isinstance(plain, FunctionType) and plain.__module__ == module.__name__:
                yield plain


def names_of(code: CodeType) -> set[str]:
    """Global names and attributes that it or a comprehension or lambda in it asks for.

    A function in it that has a name may be one that it has compiled.
    """
    consts = [const for const in code.co_consts if isinstance(const, CodeType)]
    inner = [const for const in consts if const.co_name.startswith("<")]
    return set(code.co_names).union(*map(names_of, inner))


def called(function: FunctionType) -> Iterator[str]:
    """Kernels without a way in that a plain function names: itself, or of a module that it names.

    Modules that it imports itself are found by their names, too.
    """
    names, known = names_of(function.__code__), function.__globals__
    for name in names:
        value = known.get(name)
        if is_internal(value):
            yield name
        if isinstance(value, ModuleType):
            yield from (f"{name}.{n}" for n in names - {name} if is_internal(vars(value).get(n)))


@pytest.fixture(scope="module")
def all_modules() -> list[ModuleType]:
    return modules()


def test_there_are_such_kernels(all_modules):
    found = {id(v) for module in all_modules for v in vars(module).values() if is_internal(v)}
    assert len(found) > 20


def test_python_calls_only_kernels_with_a_way_in(all_modules):
    wrong = {
        f"{module.__name__}.{function.__qualname__} calls {name}"
        for module in all_modules
        for function in functions(module)
        for name in called(function)
    }
    assert not wrong


def called_by_tests(path: Path) -> Iterator[str]:
    """Kernels without a way in that a test file calls, by the names that it imports."""
    tree = ast.parse(path.read_text())
    known: dict[str, object] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in NAMES:
            for alias in node.names:
                known[alias.asname or alias.name] = imported(node.module or "", alias.name)
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        asked = node.func
        if isinstance(asked, ast.Name) and is_internal(known.get(asked.id)):
            yield asked.id
        if isinstance(asked, ast.Attribute) and isinstance(asked.value, ast.Name):
            module = known.get(asked.value.id)
            if isinstance(module, ModuleType) and is_internal(getattr(module, asked.attr, None)):
                yield f"{asked.value.id}.{asked.attr}"


def imported(module: str, name: str) -> object:
    found = getattr(importlib.import_module(module), name, None)
    return importlib.import_module(f"{module}.{name}") if found is None else found


def test_tests_call_only_kernels_with_a_way_in():
    """But for functions that they compile themselves."""
    root = Path(__file__).parent
    wrong = {
        f"{path.relative_to(root)} calls {name}"
        for path in root.rglob("*.py")
        for name in called_by_tests(path)
    }
    assert not wrong
