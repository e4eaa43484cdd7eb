"""Truth of Starry Night data: Vicon positions of the points and poses of the vehicle."""

from pathlib import Path

from fleet.evaluation.truth import TrueTrack, Truth
from fleet.replay.starry_night import Shapes, load, nanoseconds, variables
from tagmap.conventions import Array
from tagmap.geometry import se3, so3

TRACK: Shapes = {"t": (1, "K"), "theta_vk_i": (3, "K"), "r_i_vk_i": (3, "K")}
LANDMARKS: Shapes = {"rho_i_pj_i": (3, "J")}


def read_truth(path: Path) -> Truth:
    """What the file says of the truth: landmarks, track, both or neither.

    `theta_vk_i` is the axis-angle of C_vi = cos I + (1 - cos) a a^T - sin a^x = exp(-theta^x),
    which takes inertial vectors to the vehicle; T_truth_base holds its transpose.
    """
    names = variables(path)
    landmarks: dict[str, Array] = {}
    tracks: dict[int, TrueTrack] = {}
    if LANDMARKS.keys() <= names:
        points = load(path, LANDMARKS)["rho_i_pj_i"].T
        landmarks = {str(j + 1): p for j, p in enumerate(points)}
    if TRACK.keys() <= names:
        data = load(path, TRACK)
        T = se3.from_p_R(data["r_i_vk_i"].T, so3.exp(data["theta_vk_i"].T))
        tracks = {1: TrueTrack(nanoseconds(data["t"]), T)}
    return Truth("spatial", landmarks, tracks)
