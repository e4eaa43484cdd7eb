"""Truth of Starry Night data: Vicon positions of the points and poses of the vehicle."""

from pathlib import Path

from fleet.evaluation.truth import TrueTrack, Truth
from fleet.replay.starry_night import Shapes, load, nanoseconds
from tagmap.geometry import se3, so3

SHAPES: Shapes = {
    "t": (1, "K"),
    "theta_vk_i": (3, "K"),
    "r_i_vk_i": (3, "K"),
    "rho_i_pj_i": (3, "J"),
}


def read_truth(path: Path) -> Truth:
    """`theta_vk_i` is the axis-angle of C_vi = cos I + (1 - cos) a a^T - sin a^x = exp(-theta^x),
    which takes inertial vectors to the vehicle; T_truth_base holds its transpose.
    """
    data = load(path, SHAPES)
    T = se3.from_p_R(data["r_i_vk_i"].T, so3.exp(data["theta_vk_i"].T))
    landmarks = {str(j + 1): p for j, p in enumerate(data["rho_i_pj_i"].T)}
    return Truth("spatial", landmarks, {1: TrueTrack(nanoseconds(data["t"]), T)})
