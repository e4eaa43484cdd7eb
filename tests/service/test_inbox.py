import threading

from tagmap.mapping.draft import Arrival
from tagmap.service.inbox import Inbox


def arrival(i):
    return Arrival("r1", bytes([i]))


def test_takes_events_and_a_bounded_batch_in_order():
    inbox = Inbox(capacity=10)
    for i in range(5):
        inbox.put_arrival(arrival(i))
    inbox.put("query")
    events, arrivals = inbox.take(at_most=3, timeout_s=0)
    assert events == ["query"]
    assert [a.payload[0] for a in arrivals] == [0, 1, 2]
    assert len(inbox.take(at_most=3, timeout_s=0)[1]) == 2


def test_nothing_happens_within_the_timeout():
    assert Inbox(1).take(at_most=1, timeout_s=0.01) == ([], [])


def test_a_full_inbox_makes_the_sender_wait_until_there_is_room():
    inbox = Inbox(capacity=1)
    inbox.put_arrival(arrival(0))
    sender = threading.Thread(target=inbox.put_arrival, args=(arrival(1),))
    sender.start()
    sender.join(0.05)
    assert sender.is_alive()
    inbox.take(at_most=1, timeout_s=0)
    sender.join(5.0)
    assert not sender.is_alive()
    assert inbox.take(at_most=1, timeout_s=0)[1] == [arrival(1)]


def test_closing_lets_senders_go():
    inbox = Inbox(capacity=1)
    inbox.put_arrival(arrival(0))
    sender = threading.Thread(target=inbox.put_arrival, args=(arrival(1),))
    sender.start()
    inbox.close()
    sender.join(5.0)
    assert not sender.is_alive()


def test_under_load_arrivals_are_gathered_and_events_do_not_wait_for_them():
    inbox = Inbox(capacity=100, gather_s=60.0)
    inbox.put_arrival(arrival(0))
    assert inbox.take(at_most=9, timeout_s=60.0)[1] == [arrival(0)]
    inbox.put_arrival(arrival(1))
    assert inbox.take(at_most=9, timeout_s=0.0) == ([], [])
    inbox.put("query")
    assert inbox.take(at_most=9, timeout_s=60.0) == (["query"], [])


def test_gathering_ends_when_its_time_is_over():
    inbox = Inbox(capacity=100, gather_s=0.02)
    for i in range(3):
        inbox.put_arrival(arrival(i))
        assert inbox.take(at_most=9, timeout_s=60.0)[1] == [arrival(i)]


def test_gathering_ends_when_much_has_come():
    inbox = Inbox(capacity=8, gather_s=60.0)
    inbox.put_arrival(arrival(0))
    inbox.take(at_most=9, timeout_s=60.0)
    inbox.put_arrival(arrival(1))
    sender = threading.Thread(target=inbox.put_arrival, args=(arrival(2),))
    sender.start()
    assert len(inbox.take(at_most=9, timeout_s=60.0)[1]) == 2
    sender.join()
