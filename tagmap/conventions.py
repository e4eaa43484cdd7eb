"""The conventions that every file obeys. Read this page first.

Frames
    map        the site: z up; absolute once the map is anchored, else floating
    odom       continuous, one per agent session; its origin is the session's first keyframe
    base       the robot: x forward, y left, z up (REP-103)
    cam        left camera, optical: x right, y down, z forward
    cam_right  right camera, optical
    pan, tilt  turn with the axes of a pan-tilt unit: z of pan is the pan axis, upwards, y of tilt
               the tilt axis, to the left; angles are positive to the left and upwards
    laser      the scanner: origin on the axis of mirror Y, x along that axis, y along the
               undeflected beam, z towards mirror X; it rides with the camera
    `map -> odom -> base` as in REP-105. In a planar problem `cam` has no height: x forward, y left.

Transforms
    `T_a_b` takes b-coordinates to a, so inner names cancel: T_map_cam = T_map_base @ T_base_cam.
    SE(3) is a (..., 4, 4) and SE(2) a (..., 3, 3) homogeneous matrix, float64.
    `p_map_tag` is the position of the tag in map, `R_map_base` a rotation, `cov_map_tag` a
    covariance in map axes.
    At the edges rotations are unit quaternions (w, x, y, z), or `theta_rad` in the plane.

Tangent space
    Order (v, omega): translation before rotation; (vx, vy, vz, wx, wy, wz) or (vx, vy, w).
    Update T <- T @ exp(delta): perturbations live in the last (body) frame.
    A pose covariance is that of delta, in that order: Cov(T_map_base) is in base axes.
    The covariance of an odometry step T_prev_cur lives in the cur frame.

Covariances travel as row-wise upper triangles, n (n + 1) / 2 numbers: 3 for 2x2, 6 for 3x3, 10 for
    4x4, 21 for 6x6. They are always present or explicitly null, never zero for "don't know".

Units
    SI and radians inside, float64. A scalar that crosses an edge carries its unit in its name
    (`_m _s _rad _px _hz`). Time is integer nanoseconds `t_ns`, UTC on the wire.

Images
    Pixels are raw (distorted); (0, 0) is the centre of the top-left pixel.
    A stereo pixel is (u_left, v_left, u_right, v_right).

Bearings are positive to the left of the forward axis: atan2(y, x) in a planar cam,
    atan2(-x, z) in an optical cam. Ranges are straight-line distances from the cam origin.

Names
    Sites and robots: see NAME; each robot has a unique number 1..65535.
    Tag ids: see TAG_ID; lower-case hex EPC or a given name.
    Session ids: see SESSION_ID; new at every start of an agent.

Problem kinds: `spatial` (SE(3) poses, 3-D tags) and `planar` (SE(2) poses, 2-D tags), one solver.
"""

from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
Index: TypeAlias = npt.NDArray[np.int64]
Mask: TypeAlias = npt.NDArray[np.bool_]
Kind: TypeAlias = Literal["spatial", "planar"]
Form: TypeAlias = Literal["stereo_px", "mono_px", "point_cam_m", "range_bearing"]

# `$` alone would let a trailing newline pass.
NAME = r"^[a-z0-9][a-z0-9_-]{0,31}$(?!\n)"
TAG_ID = r"^[a-z0-9][a-z0-9_-]{0,127}$(?!\n)"
SESSION_ID = r"^[a-z0-9][a-z0-9-]{7,35}$(?!\n)"

POSE_DOF: dict[Kind, int] = {"spatial": 6, "planar": 3}
TAG_DOF: dict[Kind, int] = {"spatial": 3, "planar": 2}
