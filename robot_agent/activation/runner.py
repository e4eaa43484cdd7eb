"""Carries out what a shot asks for: interlock, reader, service and clock around the generator."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, assert_never

from robot_agent.activation.commands import (
    Act,
    Aim,
    Allow,
    Answered,
    Ask,
    Command,
    Dark,
    Denied,
    Light,
    Listen,
    Read,
    Reply,
    Rest,
    Value,
    Wait,
    Write,
)
from robot_agent.laser.interlock import Interlock
from robot_agent.rfid.reader import RfidReader
from tagmap.records.lease import LeaseReply

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Devices:
    """now_ns   the clock of the interlock and of the lease
    wait_until  returns then
    ask         the service for a lease (wanted_s, done, timeout_s); None: no answer in time
    """

    interlock: Interlock
    reader: RfidReader
    now_ns: Callable[[], int]
    wait_until: Callable[[int], None]
    ask: Callable[[float, int | None, float], LeaseReply | None]


def carry_out(act: Act[T], devices: Devices) -> T:
    """To its end. Whatever happens, the laser is off and nobody may light it when this returns."""
    interlock = devices.interlock
    try:
        command = next(act)
        while True:
            interlock.beat()
            value = _obey(command, devices)
            command = act.send(Reply(value, devices.now_ns()))
    except StopIteration as end:
        result: T = end.value
        return result
    finally:
        interlock.allow(None, interlock.mark())
        act.close()


def _obey(command: Command, devices: Devices) -> Value:
    interlock, reader = devices.interlock, devices.reader
    match command:
        case Aim(steps):
            return _denied(interlock.steer(steps))
        case Light(for_s):
            return _denied(interlock.light(for_s))
        case Dark():
            interlock.dark()
        case Listen(window_s):
            return reader.inventory(window_s)
        case Read(tag, timeout_s):
            return reader.read_user(tag, 0, None, timeout_s)
        case Write(tag, first_word, words, timeout_s):
            return reader.write_user(tag, first_word, words, timeout_s)
        case Wait(until_ns):
            devices.wait_until(until_ns)
        case Rest(for_s):
            return _denied(interlock.tired(for_s))
        case Ask(wanted_s, done, timeout_s):
            mark = interlock.mark()
            return Answered(devices.ask(wanted_s, done, timeout_s), mark)
        case Allow(permit, since):
            interlock.allow(permit, since or interlock.mark())
        case _:
            assert_never(command)
    return None


def _denied(why: str | None) -> Denied | None:
    return None if why is None else Denied(why)
