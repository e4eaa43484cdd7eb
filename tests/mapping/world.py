"""A planar room a test can picture: four tags at the corners of a 4 m square around the origin, and
a robot that drives along x, 0.1 m a keyframe, and sees all of them.
"""

import numpy as np

from tagmap.estimation.solution import SessionEstimate, Solution, TagEstimate
from tagmap.geometry import se2
from tagmap.records import Measurement, Sighting
from tagmap.records.arrays import vector
from tests.mapping.messages import COV_2, SESSION, keyframe

TAGS = {
    "1": np.array([2.0, 2.0]),
    "2": np.array([-2.0, 2.0]),
    "3": np.array([-2.0, -2.0]),
    "4": np.array([2.0, -1.0]),
}


def T_map_base(seq):
    return se2.from_p_theta(np.array([0.1 * (seq - 1), 0.0]), 0.0)


def seen(T, tag, p_map):
    z = Measurement(point_cam_m=vector(se2.act(se2.inverse(T), p_map)), cov=COV_2)
    return Sighting(tag=tag, id_by="given", p_false=0.0, z=z)


def drive(seq, sees=tuple(TAGS), **fields):
    """The keyframe of this seq; odometry and sightings without error."""
    sightings = tuple(seen(T_map_base(seq), tag, TAGS[tag]) for tag in sees)
    return keyframe(seq, sightings=sightings, **fields)


def solution(through=0, gauge="anchored", T=None, tags=TAGS, robot="r1", session=SESSION, **fields):
    """The true map, moved by T, and the robot's poses up to seq `through`."""
    T = np.eye(3) if T is None else T
    estimates = tuple(
        TagEstimate(tag, se2.act(T, p), 1e-6 * np.eye(2), 9, "mapped") for tag, p in tags.items()
    )
    cov = np.full((through, 6), np.nan)
    cov[-1:] = [1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6]
    seqs = np.arange(1, through + 1)
    poses = SessionEstimate(
        robot=robot,
        session=session,
        seqs=seqs,
        t_ns=1_000_000_000 + seqs * 100_000_000,
        T=np.array([T @ T_map_base(seq) for seq in seqs]).reshape(-1, 3, 3),
        cov=cov,
        connected=through > 0,
    )
    parts = {
        "kind": "planar",
        "gauge": gauge,
        "tags": estimates,
        "sessions": (poses,),
        "scale": None,
        "stereo_scale": None,
        "converged": True,
        "iterations": 1,
        "cost": 0.0,
        "inliers": 9,
        "rejected": 0,
        "solve_s": 0.0,
        "report": (),
    }
    return Solution(**(parts | fields))
