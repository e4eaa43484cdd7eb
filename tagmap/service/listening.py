"""Everything that arrives for the service goes into its inbox, whatever it is."""

from tagmap.link.keys import Keys
from tagmap.link.query import Query
from tagmap.mapping.draft import Arrival
from tagmap.service.memories import JobAnswer
from tagmap.service.ports import Receiving, ServiceLink
from tagmap.service.shell import Presence

RING = 2048


def listen(link: ServiceLink, keys: Keys, inbox: Receiving) -> None:
    """The robot is the key's, whatever the payload says."""

    def on_keyframe(key: str, payload: bytes) -> None:
        inbox.put_arrival(Arrival(keys.robot_of(key) or "", payload))

    def on_presence(key: str, alive: bool) -> None:
        inbox.put(Presence(keys.robot_of(key) or "", alive))

    def on_result(key: str, payload: bytes) -> None:
        inbox.put(JobAnswer(keys.robot_of(key) or "", payload))

    def on_query(query: Query) -> None:
        inbox.put(query)

    link.watch_alive(keys.alive(), on_presence)
    maps = (keys.map_version(), f"{keys.map_tags()}/**")
    for key_expr in (
        keys.ack(),
        keys.pose(),
        keys.jobs(),
        *maps,
        keys.localize(),
        keys.lease(),
        keys.admin(),
    ):
        link.serve(key_expr, on_query)
    link.subscribe(keys.keyframes(), on_keyframe, capacity=RING)
    link.subscribe(keys.job_results(), on_result, capacity=RING)
