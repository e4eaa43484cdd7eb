"""Judges every message once: stored, already there, or refused with a reason.

The verdict depends on what is known about the site and the session, not on the order in which
keyframes arrive. A keyframe may come before its hello; a session whose hello is refused is refused
as a whole, until it sends a hello that is acceptable. Likewise a refused keyframe is settled, but
a valid one in its place is still stored: a spoilt copy never costs the original.
"""

import re

from tagmap.arbitration.grants import Grants
from tagmap.conventions import NAME, SESSION_ID, Kind
from tagmap.errors import RecordRefused
from tagmap.mapping.draft import Arrival, Draft, Refused
from tagmap.mapping.ledger import RobotLedger
from tagmap.mapping.session import SessionIndex
from tagmap.mapping.usable import objection
from tagmap.records import Hello, Keyframe, address_of, decode
from tagmap.records.codec import Address

MAX_ROBOTS = 65535
MAX_SEQ = 2**53
MAX_REASON = 300


class Ingest:
    """Everything settled at a site, by robot and session.

    `grants`: whose lease was when; None where nobody grants any, and their numbers say nothing.
    """

    def __init__(self, site: str) -> None:
        self.site = site
        self.kind: Kind | None = None
        self.robots: dict[str, RobotLedger] = {}
        self.holders: dict[int, str] = {}
        self.stray = 0
        self.grants: Grants | None = None

    def take(self, arrival: Arrival, draft: Draft) -> None:
        """Judge one message and write the verdict into `draft`."""
        ledger = self.ledger(arrival.robot)
        if ledger is None:
            self.stray += 1
            return
        ledger.counters.received += 1
        address = _valid_address(arrival.payload)
        try:
            if address is None:
                decode(Keyframe, arrival.payload)
                raise RecordRefused("malformed: no valid session and seq")
            if address.seq == 0:
                self._take_hello(ledger, decode(Hello, arrival.payload), draft)
            else:
                self._take_keyframe(ledger, decode(Keyframe, arrival.payload), draft)
        except RecordRefused as error:
            if address is None:
                ledger.counters.malformed += 1
                draft.note("malformed", robot=ledger.robot, reason=error.reason[:MAX_REASON])
            else:
                self._refuse(ledger, address, error.reason[:MAX_REASON], draft)

    def restore(self, index: SessionIndex, number: int | None) -> None:
        """Take back what the database says about a session; accepted hellos oldest first."""
        ledger = self.robots.setdefault(index.robot, RobotLedger(index.robot))
        ledger.sessions[index.session] = index
        if index.hello is None:
            return
        self.kind = self.kind or index.hello.kind
        ledger.number = number or index.hello.number
        self.holders[ledger.number] = index.robot

    def ledger(self, robot: str) -> RobotLedger | None:
        """Of a robot heard of, made when new; None where that is no name, or one too many."""
        ledger = self.robots.get(robot)
        if ledger is None and re.fullmatch(NAME, robot) and len(self.robots) < MAX_ROBOTS:
            ledger = self.robots[robot] = RobotLedger(robot)
        return ledger

    def _take_hello(self, ledger: RobotLedger, hello: Hello, draft: Draft) -> None:
        self._check_names(ledger, hello)
        index = ledger.sessions.get(hello.session)
        if index is not None and index.hello is not None:
            self._count_duplicate(ledger, index, 0, index.hello != hello, draft)
            return
        self._check_hello(ledger, hello)
        index = ledger.open(hello)
        self.kind = hello.kind
        self.holders[hello.number] = ledger.robot
        ledger.counters.hellos += 1
        draft.accept(hello)
        draft.note("hello accepted", robot=ledger.robot, session=hello.session, kind=hello.kind)
        self._judge_early(ledger, index, draft)

    def _take_keyframe(self, ledger: RobotLedger, keyframe: Keyframe, draft: Draft) -> None:
        self._check_names(ledger, keyframe)
        index = ledger.session(keyframe.session)
        if index.is_too_far(keyframe.seq):
            self._postpone(ledger, keyframe.session, keyframe.seq, draft)
        elif index.is_stored(keyframe.seq):
            contradiction = index.contradicts(keyframe)
            self._count_duplicate(ledger, index, keyframe.seq, contradiction, draft)
        else:
            _check_session(index, keyframe)
            self._check_leases(ledger.robot, keyframe)
            index.store(keyframe)
            ledger.counters.stored += 1
            draft.accept(keyframe)

    def _check_names(self, ledger: RobotLedger, message: Hello | Keyframe) -> None:
        if message.robot != ledger.robot:
            raise RecordRefused(f"names robot {message.robot}, the key names {ledger.robot}")
        if message.site != self.site:
            raise RecordRefused(f"names site {message.site}, this is {self.site}")

    def _check_hello(self, ledger: RobotLedger, hello: Hello) -> None:
        if self.kind is not None and hello.kind != self.kind:
            raise RecordRefused(f"a {hello.kind} session, the site is {self.kind}")
        holder = self.holders.get(hello.number, ledger.robot)
        if holder != ledger.robot:
            raise RecordRefused(f"number {hello.number} belongs to robot {holder}")
        if ledger.number is not None and ledger.number != hello.number:
            raise RecordRefused(f"number {hello.number}, this robot has number {ledger.number}")

    def _check_leases(self, robot: str, keyframe: Keyframe) -> None:
        """What was lit without a lease in force may have been another robot's tag."""
        if self.grants is None:
            return
        for i, sighting in enumerate(keyframe.sightings):
            if sighting.id_by == "laser" and sighting.lease is not None:
                reason = self.grants.objection(robot, sighting.lease, keyframe.t_ns)
                if reason is not None:
                    raise RecordRefused(f"sightings[{i}]: {reason}")

    def _judge_early(self, ledger: RobotLedger, index: SessionIndex, draft: Draft) -> None:
        """Keyframes that came before their hello are stored already; it may disallow some."""
        assert index.hello is not None
        for keyframe in list(index.recent.values()):
            reason = objection(index.hello, keyframe)
            if reason is not None:
                ledger.counters.withdrawn += 1
                self._settle_refused(index, keyframe.seq, reason, draft)

    def _refuse(self, ledger: RobotLedger, address: Address, reason: str, draft: Draft) -> None:
        index = ledger.session(address.session)
        if index.is_too_far(address.seq):
            self._postpone(ledger, address.session, address.seq, draft)
            return
        ledger.counters.refused += 1
        if index.is_stored(address.seq):
            draft.touch(ledger.robot, index.session, [address.seq])
            draft.note("refused, stored before", robot=ledger.robot, reason=reason)
            return
        if address.seq == 0:
            index.refused = reason
        self._settle_refused(index, address.seq, reason, draft)

    def _settle_refused(self, index: SessionIndex, seq: int, reason: str, draft: Draft) -> None:
        draft.touch(index.robot, index.session, [seq])
        if index.refusals.get(seq) != reason:
            index.refuse(seq, reason)
            draft.refuse(Refused(index.robot, index.session, seq, reason))
            place = {"robot": index.robot, "session": index.session, "seq": seq}
            draft.note("refused", reason=reason, **place)

    def _count_duplicate(
        self, ledger: RobotLedger, index: SessionIndex, seq: int, contradicts: bool, draft: Draft
    ) -> None:
        ledger.counters.duplicates += 1
        draft.touch(ledger.robot, index.session, [seq])
        if contradicts:
            ledger.counters.contradictions += 1
            draft.note("contradiction", robot=ledger.robot, session=index.session, seq=seq)

    def _postpone(self, ledger: RobotLedger, session: str, seq: int, draft: Draft) -> None:
        ledger.counters.postponed += 1
        draft.note("postponed", robot=ledger.robot, session=session, seq=seq)


def _check_session(index: SessionIndex, keyframe: Keyframe) -> None:
    if index.refused is not None:
        raise RecordRefused(f"the session is refused: {index.refused}"[:MAX_REASON])
    if index.hello is not None:
        reason = objection(index.hello, keyframe)
        if reason is not None:
            raise RecordRefused(reason)


def _valid_address(payload: bytes) -> Address | None:
    """Where a message belongs, if it names a session and a seq that can exist."""
    address = address_of(payload)
    if address is None or not 0 <= address.seq <= MAX_SEQ:
        return None
    return address if re.fullmatch(SESSION_ID, address.session) else None
