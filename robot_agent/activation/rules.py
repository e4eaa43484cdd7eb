"""What a shot costs, and what it must show."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ShotRules:
    """
    reach_m        a beam lights a tag that it passes so near
    threshold_m    silence from farther away says nothing about the match
    window_s       in which a lit tag must be heard, at least twice
    margin_s       the laser stays on that much longer, for the line to the reader
    settle_s       of light or dark before the reader is asked: the tag's power, after-glow
    memory_s       to read a memory; 0: memories are not read
    write_s        to write one record and read it back
    most_shots     places that a search tries
    search_sigmas  how far it goes
    tries          windows with more than one ID, before the verdict is ambiguous
    p_stray        that a tag which is not lit is heard in one window
    p_lit          where two spots are no match: that the right one's tag is lit, from all sides
    most_p_false   an identity that is wrong with more probability is none
    ask_s          an answer of the service that takes longer is none
    """

    reach_m: float = 0.02
    threshold_m: float = 30.0
    window_s: float = 0.06
    margin_s: float = 0.02
    settle_s: float = 0.005
    memory_s: float = 0.1
    write_s: float = 0.25
    most_shots: int = 19
    search_sigmas: float = 3.5
    tries: int = 3
    p_stray: float = 1e-3
    p_lit: float = 0.05
    most_p_false: float = 1e-3
    ask_s: float = 0.3

    @property
    def shot_s(self) -> float:
        """One silent window."""
        return self.settle_s + self.window_s + self.margin_s

    @property
    def longest_s(self) -> float:
        """What it asks for at a time: to look, to read, to write."""
        work_s = max(self.memory_s or self.window_s, self.write_s)
        return max(self.shot_s, work_s + self.margin_s)

    @property
    def proof_s(self) -> float:
        """The first window that is not silent, the dark one, one to each of four sides, memory."""
        return 6.0 * self.shot_s + self.memory_s
