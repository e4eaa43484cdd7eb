"""One figure or table as it goes into the report and into numbers.json."""

from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias

Key: TypeAlias = Literal[
    "figure_3_12",
    "figure_4_5",
    "figure_4_6",
    "figure_4_7",
    "figure_4_8",
    "figure_4_9",
    "danger_cylinder",
    "table_4_1",
    "table_4_2",
    "table_4_3",
    "table_4_4",
    "table_4_5",
]


@dataclass(frozen=True, slots=True)
class Claim:
    """What the thesis says, or what follows from it, and what the simulation gives for it."""

    what: str
    thesis: str
    found: float
    unit: str
    holds: bool | None


@dataclass(frozen=True, slots=True)
class Table:
    """Cells are text or numbers; None where there is none."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float | None, ...], ...]


@dataclass(frozen=True, slots=True)
class Section:
    """finding: what came out, in a sentence. data: all that is drawn, JSON, units in the names."""

    key: Key
    title: str
    reported: str
    finding: str
    assumed: tuple[str, ...]
    claims: tuple[Claim, ...]
    data: dict[str, Any]
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def picture(self) -> str:
        return f"{self.key.replace('_', '-')}.png"

    def as_contract(self) -> dict[str, Any]:
        return {
            "title": self.title,
            "reported": self.reported,
            "finding": self.finding,
            "assumed": list(self.assumed),
            "notes": list(self.notes),
            "claims": [asdict(claim) for claim in self.claims],
            "picture": self.picture,
            "data": self.data,
        }
