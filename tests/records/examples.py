"""One example of every message, with every optional part filled in somewhere."""

from tagmap.records import (
    Ack,
    AdminReply,
    AdminRequest,
    CalibrationSigmas,
    CameraCalibration,
    Hello,
    IdentifiedMeasurement,
    Introduction,
    JobResult,
    Keyframe,
    LeaseReply,
    LeaseRequest,
    Limits,
    LocalizeReply,
    LocalizeRequest,
    MapVersion,
    Measurement,
    Observation,
    Odometry,
    Pose,
    Refusal,
    RigCalibration,
    Sighting,
    Tag,
    Transform,
    WriteJob,
)
from tagmap.records.base import Message

COV_2 = (0.01, 0.001, 0.02)
COV_3 = (0.01, 0.001, 0.0, 0.02, 0.0, 0.03)
COV_4 = (0.09, 0.0, 0.01, 0.0, 0.09, 0.0, 0.01, 0.09, 0.0, 0.09)
COV_6 = (1e-4, 0, 0, 0, 0, 0, 1e-4, 0, 0, 0, 0, 1e-4, 0, 0, 0, 1e-6, 0, 0, 1e-6, 0, 1e-6)
COV_6 = tuple(map(float, COV_6))

AT_DOOR = Transform(p_m=(1.0, 2.0, 0.25), q_wxyz=(0.5, 0.5, -0.5, 0.5))
STEP = Transform(p_m=(0.1, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0))
FLAT = Transform(p_m=(1.0, -2.0), theta_rad=0.75)

CAMERA = CameraCalibration(
    width_px=1280,
    height_px=800,
    fx_px=600.5,
    fy_px=601.0,
    cx_px=639.5,
    cy_px=399.5,
    dist=(-0.25, 0.125, 0.0, 0.0, -0.03125),
)
RIG = RigCalibration(
    left=CAMERA,
    right=CAMERA,
    T_right_left=Transform(p_m=(-0.2, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0)),
    sigma_px=0.25,
    made="2026-01-31",
    by="chessboard",
    rms_px=0.125,
)

STEREO = Measurement(stereo_px=(640.0, 400.0, 610.0, 400.5), cov=COV_4)
MONO = Measurement(mono_px=(640.0, 400.0), cov=COV_2)
POINT = Measurement(point_cam_m=(0.5, -0.25, 4.0), cov=COV_3)
FLAT_POINT = Measurement(point_cam_m=(4.0, 0.5), cov=COV_2)
POLAR = Measurement(range_m=4.0, bearing_rad=-0.5, cov=COV_2)

SIGHTINGS = (
    Sighting(tag="e2001", id_by="laser", p_false=0.001, lease=7, z=STEREO, memory=b"\xe5\x01"),
    Sighting(tag="e2002", id_by="track", p_false=0.0, z=MONO),
    Sighting(tag="e2003", id_by="gate", p_false=0.25, z=POINT),
    Sighting(tag="door", id_by="constellation", p_false=1.0, z=POLAR),
)
FLAT_SIGHTINGS = (
    Sighting(tag="6", id_by="given", p_false=0.0, z=FLAT_POINT),
    Sighting(tag="17", id_by="given", p_false=0.0, z=POLAR),
)
SESSION = "20260131-a1b2c3d4"

EXAMPLES: dict[str, Message] = {
    "introduction": Introduction(kind="planar", rig=None, range_scale_sigma=0.01),
    "hello": Hello(
        kind="spatial",
        rig=RIG,
        limits=Limits(reader_range_m=85.0, write_range_m=4.0),
        stereo_scale_sigma=0.002,
        site="hall",
        robot="r1",
        number=1,
        session=SESSION,
    ),
    "hello_calibrated": Hello(
        kind="planar",
        rig=None,
        calibration=CalibrationSigmas(range_scale=0.02, camera_rad=0.005, time_offset_s=0.02),
        site="hall",
        robot="r3",
        number=3,
        session=SESSION,
    ),
    "observation": Observation(t_ns=1, odom=None, T_base_cam=FLAT, sightings=FLAT_SIGHTINGS),
    "keyframe": Keyframe(
        t_ns=1769853600000000001,
        odom=Odometry(T_prev_cur=STEP, cov=COV_6),
        T_base_cam=AT_DOOR,
        sightings=SIGHTINGS,
        site="hall",
        robot="r1",
        session=SESSION,
        seq=12,
    ),
    "keyframe_planar": Keyframe(
        t_ns=1769853600000000001,
        odom=Odometry(T_prev_cur=FLAT, cov=COV_3),
        T_base_cam=FLAT,
        sightings=FLAT_SIGHTINGS,
        site="hall",
        robot="r2",
        session=SESSION,
        seq=1,
    ),
    "ack": Ack(session=SESSION, contiguous=41, refused=(Refusal(seq=40, reason="why"),)),
    "pose": Pose(
        T_map_base=AT_DOOR,
        T_map_odom=STEP,
        robot_session=SESSION,
        cov=COV_6,
        map_version=3,
        gauge="anchored",
        state="good",
        dop=1.5,
        protection_level_m=0.25,
        source="service",
        t_ns=1769853600000000001,
    ),
    "pose_lost": Pose(
        T_map_base=None,
        T_map_odom=None,
        robot_session=SESSION,
        cov=None,
        map_version=None,
        gauge="floating",
        state="lost",
        dop=None,
        protection_level_m=None,
        source="agent",
        t_ns=0,
    ),
    "tag": Tag(
        tag="e2001",
        p_m=(1.0, 2.0, 2.5),
        cov=COV_3,
        state="mapped",
        n=120,
        version=3,
        gauge="anchored",
    ),
    "map_version": MapVersion(
        version=3, t_ns=1, cause="solve", gauge="anchored", moved=STEP, tags=24, withheld=1
    ),
    "localize_request": LocalizeRequest(
        kind="spatial",
        T_base_cam=AT_DOOR,
        rig=RIG,
        measurements=(IdentifiedMeasurement(tag="e2001", z=STEREO),),
    ),
    "localize_reply": LocalizeReply(
        T_map_base=AT_DOOR,
        cov=COV_6,
        chi2=4.5,
        inliers=("e2001", "e2002"),
        state="good",
        gauge="anchored",
        map_version=3,
        missing=None,
    ),
    "admin_request": AdminRequest(args={"tag": "e2001", "p_m": [1.0, 2.0, 3.0], "n": 3}),
    "admin_reply": AdminReply(error=None, data={"tags": [{"tag": "e2001", "n": 5}]}),
    "lease_request": LeaseRequest(robot="r1", wanted_s=0.5),
    "lease_request_here": LeaseRequest(
        robot="r1", wanted_s=0.0, p_m=(1.0, -2.0, 0.5), radius_m=0.25, done=7
    ),
    "lease_reply": LeaseReply(lease=7, valid_s=0.5, retry_s=0.0),
    "write_job": WriteJob(job=5, tag="e2001", record=bytes(range(44)), valid_s=60.0),
    "job_result": JobResult(
        robot="r1", job=5, tag="e2001", outcome="failed", read=b"\x00\xff", reason="no answer"
    ),
}
