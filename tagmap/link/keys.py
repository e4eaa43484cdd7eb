"""The key of everything that travels, each spelled once. An agent writes only below its own
`agents/<robot>/`, the service only elsewhere, so access control can tell them apart.

`*` in place of a name stands for every robot, tag, noun or verb: `keys.keyframes()` is what the
service subscribes to, `keys.keyframes("r1")` what r1 writes.
"""

import re
from dataclasses import dataclass

from tagmap.conventions import NAME
from tagmap.errors import LinkError

ANY = "*"


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys of one site. LinkError when `site` is not a name."""

    site: str

    def __post_init__(self) -> None:
        if not re.fullmatch(NAME, self.site):
            raise LinkError(f"site name {self.site!r} is not acceptable, expected {NAME}")

    @property
    def root(self) -> str:
        return f"tagmap/{self.site}"

    def agents(self, robot: str = ANY) -> str:
        """The prefix below which an agent writes."""
        return f"{self.root}/agents/{robot}"

    def robots(self, robot: str = ANY) -> str:
        """The prefix below which the service writes what concerns one robot."""
        return f"{self.root}/robots/{robot}"

    def keyframes(self, robot: str = ANY) -> str:
        return f"{self.agents(robot)}/keyframes"

    def agent_pose(self, robot: str = ANY) -> str:
        return f"{self.agents(robot)}/pose"

    def job_results(self, robot: str = ANY) -> str:
        return f"{self.agents(robot)}/jobs/results"

    def alive(self, robot: str = ANY) -> str:
        return f"{self.agents(robot)}/alive"

    def ack(self, robot: str = ANY) -> str:
        return f"{self.robots(robot)}/ack"

    def pose(self, robot: str = ANY) -> str:
        return f"{self.robots(robot)}/pose"

    def jobs(self, robot: str = ANY) -> str:
        return f"{self.robots(robot)}/jobs"

    def map_tags(self) -> str:
        """All tags at once; also where a list of tags is asked for."""
        return f"{self.root}/map/tags"

    def map_tag(self, tag: str = ANY) -> str:
        return f"{self.map_tags()}/{tag}"

    def map_version(self) -> str:
        return f"{self.root}/map/version"

    def localize(self) -> str:
        return f"{self.root}/localize"

    def lease(self) -> str:
        return f"{self.root}/activation/lease"

    def admin(self, noun: str = ANY, verb: str = ANY) -> str:
        return f"{self.root}/admin/{noun}/{verb}"

    def robot_of(self, key: str) -> str | None:
        """The robot whose key this is: the only trustworthy answer to who wrote a message."""
        owner, *rest = self._below_root(key)
        if owner not in ("agents", "robots") or len(rest) < 2 or not re.fullmatch(NAME, rest[0]):
            return None
        return rest[0]

    def tag_of(self, key: str) -> str | None:
        """The tag of a `map/tags/<tag>` key."""
        match self._below_root(key):
            case ["map", "tags", tag] if tag != ANY:
                return tag
        return None

    def command_of(self, key: str) -> tuple[str, str] | None:
        """Noun and verb of an `admin/<noun>/<verb>` key."""
        match self._below_root(key):
            case ["admin", noun, verb] if ANY not in (noun, verb):
                return noun, verb
        return None

    def _below_root(self, key: str) -> list[str]:
        prefix = self.root + "/"
        return key[len(prefix) :].split("/") if key.startswith(prefix) else [""]
