"""A scene as a TOML file: what `fleet emulate` reads."""

import tomllib
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.light import Always, Light, Schedule
from fleet.simulation.scene.memory import ENDURANCE, UserMemory
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Tag, TagFaults, words_of
from tagmap.errors import ConfigError

NS = 1_000_000_000
DEFAULT_WORDS = 64

Hex: TypeAlias = Annotated[str, Meta(pattern=r"^([0-9a-f]{4}){1,31}$(?!\n)")]
UserHex: TypeAlias = Annotated[str, Meta(pattern=r"^([0-9a-f]{4})*$(?!\n)", max_length=4 * 4096)]
Metres: TypeAlias = Annotated[float, Meta(ge=-1e6, le=1e6)]
Range: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e6)]
Chance: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Seconds: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e6)]
Duration: TypeAlias = Annotated[float, Meta(ge=1e-3, le=1e6)]
Count: TypeAlias = Annotated[int, Meta(ge=1)]


class _Part(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the file; a key that is not known is refused, for it would mean its default."""


class ScheduleDescription(_Part, frozen=True):
    """Lit for the first `on_s` of every `period_s`, from `start_s` after the start on."""

    period_s: Duration
    on_s: Duration
    start_s: Seconds = 0.0


class TagDescription(_Part, frozen=True):
    """One `[[tag]]`. `user` are its memory words as hex, `words` zeros when it is not given."""

    epc: Hex
    name: str | None = None
    tid: Hex = "e2003412"
    user: UserHex | None = None
    words: Annotated[int, Meta(ge=0, le=4096)] = DEFAULT_WORDS
    p_m: tuple[Metres, Metres, Metres] = (0.0, 0.0, 0.0)
    lit: Literal["always", "never"] | ScheduleDescription = "never"
    switch_on_s: Seconds = 0.002
    locked: bool = False
    endurance: Count = ENDURANCE
    dead: bool = False
    deaf: bool = False
    stray: Chance = 0.0
    power_fails_after: tuple[Count, ...] = ()


class ReaderDescription(_Part, frozen=True):
    """`[reader]`: the reader that is emulated."""

    p_m: tuple[Metres, Metres, Metres] = (0.0, 0.0, 0.0)
    range_m: Range = 85.0
    write_range_m: Range = 30.0
    missed: Chance = 0.0
    phantom: Chance = 0.0


class LaserDescription(_Part, frozen=True):
    """`[laser]`: where cam is that it rides with, and what its beam lights, see TrueLaser."""

    p_m: tuple[Metres, Metres, Metres] = (0.0, 0.0, 0.0)
    q_wxyz: tuple[Metres, Metres, Metres, Metres] = (1.0, 0.0, 0.0, 0.0)
    reach_m: Range = 0.02
    range_m: Range = 30.0


class SceneDescription(_Part, frozen=True):
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    reader: ReaderDescription = ReaderDescription()
    laser: LaserDescription = LaserDescription()
    tag: tuple[TagDescription, ...] = ()


def read_description(path: Path) -> SceneDescription:
    """Raises ConfigError, which names file and key."""
    try:
        return msgspec.convert(
            tomllib.loads(path.read_text(encoding="utf-8")), SceneDescription, strict=True
        )
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: {error}") from None


def build(description: SceneDescription, reader: str, start_ns: int) -> Scene:
    """The scene at `start_ns`, with one reader of that name. Raises ConfigError."""
    radio = description.reader
    names = [tag.name or tag.epc for tag in description.tag]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(f"two tags are called {twice[0]}; give them different `name`s")
    return Scene(
        [_tag(tag, start_ns) for tag in description.tag],
        [
            Reader(
                reader, radio.p_m, radio.range_m, radio.write_range_m, radio.missed, radio.phantom
            )
        ],
        description.seed,
    )


def _tag(tag: TagDescription, start_ns: int) -> Tag:
    words = (0,) * tag.words if tag.user is None else words_of(tag.user)
    return Tag(
        tag.name or tag.epc,
        tag.epc,
        UserMemory(words, locked=tag.locked, endurance=tag.endurance),
        tag.tid,
        tag.p_m,
        round(tag.switch_on_s * NS),
        _lights(tag.lit, start_ns),
        TagFaults(tag.dead, tag.deaf, tag.stray, list(tag.power_fails_after)),
    )


def _lights(lit: str | ScheduleDescription, start_ns: int) -> tuple[Light, ...]:
    if isinstance(lit, ScheduleDescription):
        start = start_ns + round(lit.start_s * NS)
        return (Schedule(round(lit.period_s * NS), round(lit.on_s * NS), start),)
    return (Always(),) if lit == "always" else ()
