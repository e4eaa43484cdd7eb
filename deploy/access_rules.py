"""Who may do what on a secured site, as Zenoh access control: everything not listed is denied.

    agent     puts and is alive below agents/<itself>/; hears and asks robots/<itself>/ and map/;
              asks localize and activation/lease
    service   hears agents/; puts and answers robots/, map/, localize, activation/ and admin/
    admin     asks admin/, robots/, map/ and localize; hears everything; writes nothing
    routers   pass on everything of the site to each other

Flows are seen from the router: ingress is what it receives from the participant, egress what it
sends there; a question and its answer need both, at both ends. A rule matches when its key
includes the message's key. So what the service declares for all robots at once (agents/*/keyframes,
robots/*/ack) must be announced to each agent under keys that wide, or the agent believes that
nobody listens; such announcements carry key expressions, never data.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from tagmap.link.keys import Keys
from tagmap.link.settings import Settings

Flow = Literal["ingress", "egress"]
EVERY_MESSAGE = (
    "put",
    "delete",
    "declare_subscriber",
    "declare_queryable",
    "query",
    "reply",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)
WATCH_ALIVE = ("liveliness_query", "declare_liveliness_subscriber")


@dataclass(frozen=True, slots=True)
class Identities:
    """Common names of the certificates that count: renewed ones keep it, reissued ones do not."""

    routers: tuple[str, ...]
    service: str
    admin: str
    robots: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Allow:
    flow: Flow
    messages: Iterable[str]
    keys: Iterable[str]


def access_control(keys: Keys, who: Identities) -> Settings:
    """The `access_control` section of every router of the site."""
    everything = [f"{keys.root}/**"]
    grants: list[tuple[str, list[str], list[Allow]]] = [
        ("service", [who.service], _service(keys)),
        ("admin", [who.admin], _admin(keys)),
        (
            "routers",
            list(who.routers),
            [
                Allow("ingress", EVERY_MESSAGE, everything),
                Allow("egress", EVERY_MESSAGE, everything),
            ],
        ),
    ]
    if who.robots:
        grants.append(("agents", sorted(who.robots.values()), _every_agent(keys)))
    for robot, common_name in sorted(who.robots.items()):
        grants.append((f"agent-{robot}", [common_name], _one_agent(keys, robot)))
    return _as_settings(grants)


def _one_agent(keys: Keys, robot: str) -> list[Allow]:
    own, addressed = f"{keys.agents(robot)}/**", f"{keys.robots(robot)}/**"
    return [
        Allow("ingress", ["put", "liveliness_token"], [own]),
        Allow("ingress", ["declare_subscriber", "query"], [addressed]),
        Allow("egress", ["put", "reply"], [addressed]),
    ]


def _every_agent(keys: Keys) -> list[Allow]:
    world, questions = f"{keys.root}/map/**", [keys.localize(), keys.lease()]
    return [
        Allow("ingress", ["declare_subscriber", "query"], [world]),
        Allow("egress", ["put", "reply"], [world]),
        Allow("ingress", ["query"], questions),
        Allow("egress", ["reply"], questions),
        Allow("egress", ["declare_subscriber"], [f"{keys.root}/agents/**"]),
        Allow("egress", ["declare_queryable"], [f"{keys.robots()}/**", world, *questions]),
    ]


def _service(keys: Keys) -> list[Allow]:
    agents, everything = [f"{keys.root}/agents/**"], [f"{keys.root}/**"]
    own = [f"{keys.root}/{name}/**" for name in ("robots", "map", "activation", "admin")]
    own.append(keys.localize())
    return [
        Allow("ingress", ["put", "reply", "declare_queryable"], own),
        Allow("egress", ["query"], own),
        Allow("egress", ["declare_subscriber"], everything),
        Allow("ingress", ["declare_subscriber", *WATCH_ALIVE], agents),
        Allow("egress", ["put", "liveliness_token"], agents),
    ]


def _admin(keys: Keys) -> list[Allow]:
    everything = [f"{keys.root}/**"]
    questions = [f"{keys.root}/{name}/**" for name in ("admin", "robots", "map")]
    questions.append(keys.localize())
    return [
        Allow("ingress", ["query"], questions),
        Allow("egress", ["reply"], questions),
        Allow("ingress", ["declare_subscriber", *WATCH_ALIVE], everything),
        Allow("egress", ["put", "liveliness_token", "declare_queryable"], everything),
    ]


def _as_settings(grants: Iterable[tuple[str, list[str], list[Allow]]]) -> Settings:
    rules, subjects, policies = [], [], []
    for subject, common_names, allowed in grants:
        names = [f"{subject}-{number}" for number in range(1, len(allowed) + 1)]
        rules += [_rule(name, allow) for name, allow in zip(names, allowed, strict=True)]
        subjects.append({"id": subject, "cert_common_names": common_names})
        policies.append({"rules": names, "subjects": [subject]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rule(name: str, allow: Allow) -> Settings:
    return {
        "id": name,
        "permission": "allow",
        "flows": [allow.flow],
        "messages": list(allow.messages),
        "key_exprs": list(allow.keys),
    }
