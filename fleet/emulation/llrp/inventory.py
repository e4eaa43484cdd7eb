"""Listening: rounds of inventory, commands to the tags that match, reports."""

from collections.abc import Generator, Iterable
from dataclasses import dataclass

from fleet.emulation.llrp import access
from fleet.emulation.llrp.report import AT_END, AT_END_OF_ANTENNA_SPEC, Report
from fleet.emulation.llrp.specs import AccessSpec, AiSpec, RoSpec
from fleet.simulation.scene.antenna import ROUND_NS, Antenna, Reply


@dataclass(frozen=True, slots=True)
class Listening:
    """One run of a ROSpec. `access` are the reader's commands, as they are at each moment."""

    spec: RoSpec
    access: dict[int, AccessSpec]
    antenna: Antenna
    report: Report

    def run(self, t_ns: int) -> Generator[int, int, None]:
        """Yields when to go on, is sent the time it then is; ends when the run does.

        A command under way is finished: no reader lets go of a tag in the middle of a word.
        """
        duration_ns = self.spec.duration_ns
        end_ns = None if duration_ns is None else t_ns + duration_ns
        for stretch in self.spec.antenna_specs:
            t_ns = yield from self._listen(stretch, t_ns, end_ns)
            self.report.ended(AT_END_OF_ANTENNA_SPEC)
            if end_ns is not None and t_ns >= end_ns:
                break
        self.report.ended(AT_END)

    def _listen(self, stretch: AiSpec, t_ns: int, end_ns: int | None) -> Generator[int, int, int]:
        """Rounds until one of the triggers ends it, at least one. Returns the time."""
        if stretch.duration_ns is not None:
            end_ns = _earlier(end_ns, t_ns + stretch.duration_ns)
        seen: set[str] = set()
        rounds, news_ns = 0, t_ns
        while True:
            before = len(seen)
            for reply in self.antenna.hear(t_ns):
                seen.add(reply.epc)
                self.report.heard(reply.epc, t_ns)
                t_ns = yield from self._command(reply, t_ns)
            rounds += 1
            news_ns = t_ns if len(seen) > before else news_ns
            next_ns = t_ns + ROUND_NS
            t_ns = yield next_ns if end_ns is None else min(next_ns, max(end_ns, t_ns))
            if end_ns is not None and t_ns >= end_ns:
                return t_ns
            if _is_over(stretch, len(seen), rounds, t_ns - news_ns):
                return t_ns

    def _command(self, reply: Reply, t_ns: int) -> Generator[int, int, int]:
        """All commands that are meant for this tag. Returns the time."""
        for spec in _meant(self.access.values(), self.spec.id):
            if not access.matches(spec, self.antenna, reply, t_ns):
                continue
            results = yield from access.obey(spec.commands, self.antenna, reply, t_ns)
            t_ns = yield t_ns
            self.report.obeyed(reply.epc, t_ns, spec.id, results)
            if spec.left is not None:
                spec.left -= 1
                if spec.left <= 0:
                    self.access.pop(spec.id, None)
            if spec.reports_at_once:
                self.report.send()
        return t_ns


def _meant(specs: Iterable[AccessSpec], ro_spec: int) -> list[AccessSpec]:
    return [s for s in specs if s.enabled and s.ro_spec_id in (0, ro_spec)]


def _is_over(stretch: AiSpec, tags: int, rounds: int, silence_ns: int) -> bool:
    return (
        (stretch.tags is not None and tags >= stretch.tags)
        or (stretch.rounds is not None and rounds >= stretch.rounds)
        or (stretch.silence_ns is not None and silence_ns >= stretch.silence_ns)
    )


def _earlier(a: int | None, b: int) -> int:
    return b if a is None else min(a, b)
