"""Records as TOML files that people read and write, with remarks beside the values."""

import datetime
import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from tagmap.errors import ConfigError
from tagmap.records.replacing import replace_file

Kind = TypeVar("Kind", bound=msgspec.Struct)


def read(path: Path, kind: type[Kind], tables: Mapping[str, type[msgspec.Struct]]) -> Kind:
    """Raises ConfigError, which names file and key, on anything but a complete record.

    tables: what each table holds, the record itself as "".
    """
    tree = read_tree(path)
    check_keys(str(path), tree, tables)
    if isinstance(tree.get("made"), datetime.date):
        tree["made"] = tree["made"].isoformat()
    try:
        return msgspec.convert(tree, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: {error}") from None


def read_tree(path: Path) -> dict[str, Any]:
    """Raises ConfigError where there is no TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None


def write(path: Path, record: msgspec.Struct, remarks: Mapping[str, str]) -> None:
    """Write what `read` reads, replacing the file as a whole. Raises ConfigError where `path`
    cannot be written, and leaves what was there.

    remarks: comments by key ("left.fx_px"), shown behind the value; "" goes on top of the file.
    """
    tree = msgspec.to_builtins(record)
    lines = [f"# {line}".rstrip() for line in remarks.get("", "").splitlines()]
    lines += [
        _line(key, value, remarks.get(key))
        for key, value in tree.items()
        if value is not None and not isinstance(value, dict)
    ]
    for table, values in tree.items():
        if isinstance(values, dict):
            lines += ["", f"[{table}]"]
            lines += [_line(k, v, remarks.get(f"{table}.{k}")) for k, v in values.items()]
    try:
        replace_file(path, ("\n".join(lines) + "\n").encode())
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None


def _line(key: str, value: Any, remark: str | None) -> str:
    """Strings, numbers and lists of them are written in TOML as in JSON."""
    text = f"{key} = {json.dumps(value, allow_nan=False)}"
    return f"{text}  # {remark}" if remark else text


def check_keys(name: str, tree: dict[str, Any], tables: Mapping[str, type[msgspec.Struct]]) -> None:
    """Raise ConfigError for what no such record has: a misspelt optional key would silently mean
    its default. `name` is of the file, or of the record in it."""
    for table, record in tables.items():
        part = tree.get(table, {}) if table else tree
        known = record.__struct_fields__
        for key, value in part.items() if isinstance(part, dict) else ():
            where = f"{table}.{key}" if table else key
            if key not in known:
                raise ConfigError(f"{name}: unknown key {where}, expected {', '.join(known)}")
            numbers = value if isinstance(value, list) else [value]
            if any(isinstance(x, float) and not math.isfinite(x) for x in numbers):
                raise ConfigError(f"{name}: {where} is {value}, expected finite numbers")
