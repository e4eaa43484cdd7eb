"""The agent's decisions, one by one, in virtual time."""

from collections.abc import Sequence
from itertools import pairwise

import msgspec
import pytest

from robot_agent.courier import (
    WINDOW,
    WINDOW_BYTES,
    Courier,
    Identity,
    Inputs,
    Outputs,
    Parcel,
    Room,
)
from robot_agent.flight import DOUBT_NS, LONGEST_PATIENCE_NS, PATIENCE_NS
from tagmap.errors import DataError
from tagmap.records import (
    Ack,
    CameraCalibration,
    Hello,
    Introduction,
    Keyframe,
    Measurement,
    Observation,
    Odometry,
    Refusal,
    RigCalibration,
    Sighting,
    Transform,
    decode,
)
from tagmap.records.codec import MAX_BYTES
from tagmap.records.keyframe import MAX_MEMORY_BYTES

SESSION = "session-now"
EARLIER = "session-earlier"
STEP = Odometry(
    T_prev_cur=Transform(p_m=(0.1, 0.0), theta_rad=0.0),
    cov=(1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4),
)


def observation(t_ns: int) -> Observation:
    at_base = Transform(p_m=(0.0, 0.0), theta_rad=0.0)
    return Observation(t_ns=t_ns, odom=STEP, T_base_cam=at_base, sightings=())


def parcels(seqs: Sequence[int], session: str = SESSION) -> list[Parcel]:
    return [Parcel(session, seq, b"%d" % seq) for seq in seqs]


def sent(outputs: Outputs) -> list[int]:
    return [parcel.seq for parcel in outputs.send]


@pytest.fixture
def courier() -> Courier:
    identity = Identity(site="site", robot="r1", number=1, session=SESSION)
    return Courier(identity, Introduction(kind="planar", rig=None, range_scale_sigma=0.01))


def test_the_hello_carries_the_introduction_and_the_identity(courier: Courier) -> None:
    hello = decode(Hello, courier.hello().payload)
    assert (hello.site, hello.robot, hello.number) == ("site", "r1", 1)
    assert (hello.session, hello.seq) == (SESSION, 0)
    assert (hello.kind, hello.range_scale_sigma) == ("planar", 0.01)


def test_observations_are_numbered_from_one_and_the_first_has_no_odometry(courier: Courier) -> None:
    outputs = courier.step(Inputs(observations=[observation(7), observation(8)]), now_ns=0)
    first, second = (decode(Keyframe, parcel.payload) for parcel in outputs.append)
    assert (first.seq, first.t_ns, first.odom) == (1, 7, None)
    assert (second.seq, second.t_ns, second.odom) == (2, 8, STEP)
    assert (second.site, second.robot, second.session) == ("site", "r1", SESSION)


def test_what_no_service_could_decode_goes_without_its_sightings(courier: Courier) -> None:
    """Else it would never be settled, and nothing after it."""
    sighting = Sighting(
        tag="a",
        id_by="given",
        p_false=0.0,
        z=Measurement(range_m=1.0, bearing_rad=0.0, cov=(0.01, 0.0, 0.01)),
        memory=bytes(MAX_MEMORY_BYTES),
    )
    large = msgspec.structs.replace(observation(7), sightings=(sighting,) * 120)
    outputs = courier.step(Inputs(observations=[observation(6), large]), now_ns=0)
    assert outputs.shorn == [2]
    keyframe = decode(Keyframe, outputs.append[1].payload)
    assert (keyframe.seq, keyframe.odom, keyframe.sightings) == (2, STEP, ())


def test_nothing_is_sent_before_it_came_back_from_the_outbox(courier: Courier) -> None:
    outputs = courier.step(Inputs(observations=[observation(7)]), now_ns=0)
    assert outputs.send == []


def test_parcels_are_sent_once_and_room_shrinks_by_what_is_under_way(courier: Courier) -> None:
    outputs = courier.step(Inputs(parcels=parcels(range(100))), now_ns=0)
    assert sent(outputs) == list(range(100))
    assert outputs.room.parcels == WINDOW - 100
    assert sent(courier.step(Inputs(), now_ns=1)) == []


def test_an_acknowledgement_settles_and_makes_room(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(10))), now_ns=0)
    ack = Ack(session=SESSION, contiguous=6)
    outputs = courier.step(Inputs(acks=[ack]), now_ns=1)
    assert outputs.settle == [ack]
    assert outputs.room.parcels == WINDOW - 3


def test_late_repeated_and_foreign_acknowledgements_change_nothing(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(10))), now_ns=0)
    courier.step(Inputs(acks=[Ack(session=SESSION, contiguous=6)]), now_ns=1)
    late = [
        Ack(session=SESSION, contiguous=6),
        Ack(session=SESSION, contiguous=2),
        Ack(session=SESSION, contiguous=-1),
        Ack(session="somebody-else", contiguous=99),
    ]
    outputs = courier.step(Inputs(acks=late), now_ns=2)
    assert outputs.settle == []
    assert outputs.room.parcels == WINDOW - 3


def test_an_acknowledgement_cannot_settle_what_was_never_sent(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(3))), now_ns=0)
    outputs = courier.step(
        Inputs(
            observations=[observation(7)],
            acks=[Ack(session=SESSION, contiguous=999)],
        ),
        now_ns=1,
    )
    assert outputs.settle == [Ack(session=SESSION, contiguous=2)]


def test_an_acknowledgement_of_an_earlier_session_counts_in_full(courier: Courier) -> None:
    """The process before this one may have sent more than was read back so far."""
    courier.step(Inputs(parcels=parcels(range(5, 8), EARLIER)), now_ns=0)
    ack = Ack(session=EARLIER, contiguous=20)
    assert courier.step(Inputs(acks=[ack]), now_ns=1).settle == [ack]


def test_acknowledgements_of_one_step_are_merged(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(10))), now_ns=0)
    acks = [
        Ack(session=SESSION, contiguous=4, refused=(Refusal(seq=3, reason="x"),)),
        Ack(session=SESSION, contiguous=8, refused=(Refusal(seq=7, reason="y"),)),
        Ack(session=SESSION, contiguous=5),
    ]
    [settled] = courier.step(Inputs(acks=acks), now_ns=1).settle
    assert settled.contiguous == 8
    assert {refusal.seq for refusal in settled.refused} == {3, 7}


def test_refusals_told_late_are_passed_on_once(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(10))), now_ns=0)
    courier.step(Inputs(acks=[Ack(session=SESSION, contiguous=9)]), now_ns=1)
    answer = Ack(session=SESSION, contiguous=9, refused=(Refusal(seq=3, reason="x"),))
    assert courier.step(Inputs(acks=[answer]), now_ns=2).settle == [answer]
    assert courier.step(Inputs(acks=[answer]), now_ns=3).settle == []


def test_silence_leads_to_a_question_and_only_its_answer_to_repetition(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(4))), now_ns=0)
    assert courier.step(Inputs(), now_ns=PATIENCE_NS - 1).ask == []
    asked = courier.step(Inputs(), now_ns=PATIENCE_NS)
    assert (asked.ask, sent(asked)) == ([SESSION], [])
    answer = Ack(session=SESSION, contiguous=1)
    answered = courier.step(Inputs(acks=[answer], parcels=parcels([4])), now_ns=PATIENCE_NS + 1)
    assert sent(answered) == [2, 3, 4]


def test_a_repeated_acknowledgement_tells_of_a_gap_and_shortens_the_wait_once(
    courier: Courier,
) -> None:
    courier.step(Inputs(parcels=parcels(range(10))), now_ns=0)
    ack = Ack(session=SESSION, contiguous=4)
    courier.step(Inputs(acks=[ack]), now_ns=0)
    courier.step(Inputs(acks=[ack]), now_ns=0)
    assert courier.step(Inputs(), now_ns=DOUBT_NS - 1).ask == []
    assert courier.step(Inputs(), now_ns=DOUBT_NS).ask == [SESSION]
    assert sent(courier.step(Inputs(acks=[ack]), now_ns=DOUBT_NS)) == [5, 6, 7, 8, 9]
    courier.step(Inputs(acks=[ack]), now_ns=DOUBT_NS)
    assert courier.step(Inputs(), now_ns=10 * DOUBT_NS).ask == []
    courier.step(Inputs(acks=[Ack(session=SESSION, contiguous=7)]), now_ns=10 * DOUBT_NS)
    courier.step(Inputs(acks=[Ack(session=SESSION, contiguous=7)]), now_ns=10 * DOUBT_NS)
    assert courier.step(Inputs(), now_ns=11 * DOUBT_NS).ask == [SESSION]


@pytest.mark.parametrize("size", [1, 1000, WINDOW_BYTES // 3, WINDOW_BYTES])
def test_what_is_under_way_is_bounded_in_bytes_and_never_nothing(
    courier: Courier, size: int
) -> None:
    waiting = [Parcel(SESSION, seq, bytes(size)) for seq in range(2 * WINDOW)]
    under_way = 0
    while fitting := courier.step(Inputs(), now_ns=0).room.fitting(waiting):
        courier.step(Inputs(parcels=fitting), now_ns=0)
        under_way += len(fitting)
        waiting = waiting[len(fitting) :]
    assert under_way == min(WINDOW, WINDOW_BYTES // size)


def test_an_introduction_too_large_for_the_wire_is_refused() -> None:
    camera = CameraCalibration(width_px=1, height_px=1, fx_px=1.0, fy_px=1.0, cx_px=0.0, cy_px=0.0)
    beside = Transform(p_m=(-0.1, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0))
    rig = RigCalibration(
        left=camera, right=camera, T_right_left=beside, sigma_px=0.1, by="x" * MAX_BYTES
    )
    identity = Identity(site="site", robot="r1", number=1, session=SESSION)
    with pytest.raises(DataError, match="introduction of 66228 bytes"):
        Courier(identity, Introduction(kind="spatial", rig=rig)).hello()


def test_an_absent_service_is_asked_once_a_second_and_nothing_is_repeated(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(4))), now_ns=0)
    outputs = [courier.step(Inputs(), now_ns=s * PATIENCE_NS) for s in range(1, 6)]
    assert [o.ask for o in outputs] == [[SESSION]] * 5
    assert not any(o.send for o in outputs)
    assert [o.silent for o in outputs] == [False, True, True, True, True]
    heard = courier.step(Inputs(acks=[Ack(session=SESSION, contiguous=3)]), now_ns=6 * PATIENCE_NS)
    assert not heard.silent


def test_repetitions_become_rarer_while_the_service_answers_without_progress(
    courier: Courier,
) -> None:
    courier.step(Inputs(parcels=parcels(range(4))), now_ns=0)
    repeated_at = []
    for now_ns in range(0, 40 * PATIENCE_NS, PATIENCE_NS // 4):
        outputs = courier.step(Inputs(), now_ns)
        if (
            outputs.ask
            and courier.step(Inputs(acks=[Ack(session=SESSION, contiguous=-1)]), now_ns).send
        ):
            repeated_at.append(now_ns)
    gaps = [b - a for a, b in pairwise(repeated_at)]
    assert gaps == sorted(gaps)
    assert gaps[0] == PATIENCE_NS
    assert gaps[-1] == LONGEST_PATIENCE_NS


def test_without_a_router_nothing_is_asked_and_there_is_no_room(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(4))), now_ns=0)
    outputs = courier.step(Inputs(connected=False), now_ns=5 * PATIENCE_NS)
    assert outputs.ask == []
    assert outputs.room == Room(0, 0)


def test_a_new_connection_is_used_to_ask_at_once(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(4))), now_ns=0)
    courier.step(Inputs(connected=False), now_ns=1)
    assert courier.step(Inputs(), now_ns=2).ask == [SESSION]


def test_each_session_is_asked_about_by_itself(courier: Courier) -> None:
    both = parcels([7, 8], EARLIER) + parcels([0, 1])
    assert courier.step(Inputs(parcels=both), now_ns=0).send == both
    assert courier.step(Inputs(), now_ns=PATIENCE_NS).ask == [EARLIER, SESSION]
    acks = [Ack(session=EARLIER, contiguous=8)]
    assert sent(courier.step(Inputs(acks=acks), now_ns=PATIENCE_NS + 1)) == []
    assert courier.step(Inputs(), now_ns=2 * PATIENCE_NS).ask == [SESSION]


def test_a_service_that_forgot_what_it_acknowledged_is_noticed(courier: Courier) -> None:
    courier.step(Inputs(parcels=parcels(range(10))), now_ns=0)
    courier.step(Inputs(acks=[Ack(session=SESSION, contiguous=6)]), now_ns=0)
    late = courier.step(Inputs(acks=[Ack(session=SESSION, contiguous=3)]), now_ns=0)
    assert late.torn == []
    torn = []
    for s in range(1, 30):
        outputs = courier.step(Inputs(), now_ns=s * PATIENCE_NS)
        acks = [Ack(session=session, contiguous=-1) for session in outputs.ask]
        torn += courier.step(Inputs(acks=acks), now_ns=s * PATIENCE_NS).torn
    assert set(torn) == {SESSION}
