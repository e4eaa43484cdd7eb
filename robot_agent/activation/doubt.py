"""How likely it is that a tag which answered is another one.

Three ways: the beam lit another place where a tag may be; the two spots are of two tags, and the
beam lit the right one's; the tag was not lit, and heard all the same.
"""

from robot_agent.activation.rules import ShotRules
from robot_agent.activation.target import Target

UNTRIED = 3.0
"""So much more of the beam's cross-section may hold another tag where the sides were not tried."""


def p_false(rules: ShotRules, target: Target, tag: str, p_beside: float, sides: bool) -> float:
    """Of a tag that answers in the light and not in the dark; `sides`: from all of them."""
    p_lit = rules.p_lit * (1.0 if sides else UNTRIED)
    return p_beside + p_lit * _p_mixed(target, tag) + rules.p_stray**2


def is_nameable(rules: ShotRules, target: Target) -> bool:
    """Whether any answer may name it; else a shot only shows whether its spots are no match."""
    least = min((_p_mixed(target, tag) for tag in target.names), default=target.p_match)
    return rules.p_lit * least <= rules.most_p_false


def _p_mixed(target: Target, tag: str) -> float:
    """That its spots are of two tags, though the one answers that is expected there."""
    return target.p_match * (1.0 - target.names.get(tag, 0.0))
