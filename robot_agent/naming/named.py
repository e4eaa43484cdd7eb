"""A spot with a name."""

from dataclasses import dataclass

from tagmap.records.keyframe import IdentifiedBy, Measurement, Sighting


@dataclass(frozen=True, slots=True)
class Named:
    """p_false  that it is another tag
    lease    under which it was lit, if it was
    memory   of the tag, where it was read just now
    is_place whether the spots of both images are certainly of this tag; else only the left one is
    is_lit   whether this robot has lit it, and followed it since: then a map that says otherwise is
             old
    """

    tag: str
    id_by: IdentifiedBy
    p_false: float
    lease: int | None = None
    memory: bytes | None = None
    is_place: bool = True
    is_lit: bool = False

    def sighting(self, z: Measurement) -> Sighting:
        return Sighting(
            tag=self.tag,
            id_by=self.id_by,
            p_false=self.p_false,
            lease=self.lease,
            z=z,
            memory=self.memory,
        )
