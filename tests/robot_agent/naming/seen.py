"""Skies of tags at given places, and what shots at them came to."""

import numpy as np

from fleet.simulation.views import WIDE_RIG
from robot_agent.activation.choice import PoseBelief
from robot_agent.activation.verdict import Outcome, Verdict
from robot_agent.naming.hunt import Hunt, Wishes
from robot_agent.naming.sky import Sky
from robot_agent.naming.standing import Standing
from robot_agent.perception.view import View
from tagmap.geometry import stereo
from tests.robot_agent.activation.air import AIMER

PLACES = np.array([[0.0, 0.1, 3.0], [0.8, -0.4, 3.5], [-0.9, 0.5, 4.0]])


def sky(p_cam=PLACES):
    """With the camera where base is."""
    px, _ = stereo.project(WIDE_RIG, np.array(p_cam, dtype=float))
    cov = np.tile(0.01 * np.eye(2), (len(px), 1, 1))
    usable = np.ones(len(px), dtype=bool)
    views = (View(px[:, :2], cov, usable), View(px[:, 2:], cov, usable))
    return Sky(WIDE_RIG, *views, np.eye(4))


def hunt(over, wishes=None, standing=None, **more):
    belief = PoseBelief.nothing()
    return Hunt(over, AIMER, belief, wishes or Wishes(), standing or Standing(), **more)


def outcome(target, kind, tag=None, depth=True, lease=7):
    verdict = Verdict(kind, "because", 1, tag, 1e-4 if tag else 1.0, depth=depth)
    return Outcome(target, verdict, lease, 0, 1)
