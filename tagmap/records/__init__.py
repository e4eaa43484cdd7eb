"""Facts without logic: wire messages, calibration, journals."""

from tagmap.records.ack import Ack, Refusal
from tagmap.records.admin import AdminReply, AdminRequest
from tagmap.records.codec import address_of, decode, encode
from tagmap.records.hello import CalibrationSigmas, Hello, Introduction, Limits
from tagmap.records.job import JobResult, WriteJob
from tagmap.records.keyframe import Keyframe, Measurement, Observation, Odometry, Sighting
from tagmap.records.lease import LeaseReply, LeaseRequest
from tagmap.records.localize import IdentifiedMeasurement, LocalizeReply, LocalizeRequest
from tagmap.records.pose import Pose
from tagmap.records.rig import CameraCalibration, RigCalibration
from tagmap.records.tag import MapVersion, Tag
from tagmap.records.transform import Transform

__all__ = [
    "Ack",
    "AdminReply",
    "AdminRequest",
    "CalibrationSigmas",
    "CameraCalibration",
    "Hello",
    "IdentifiedMeasurement",
    "Introduction",
    "JobResult",
    "Keyframe",
    "LeaseReply",
    "LeaseRequest",
    "Limits",
    "LocalizeReply",
    "LocalizeRequest",
    "MapVersion",
    "Measurement",
    "Observation",
    "Odometry",
    "Pose",
    "Refusal",
    "RigCalibration",
    "Sighting",
    "Tag",
    "Transform",
    "WriteJob",
    "address_of",
    "decode",
    "encode",
]
