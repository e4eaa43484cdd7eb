"""Messages a test can picture: a planar robot that steps 0.1 m forward and sees one tag."""

from tagmap.records import Hello, Keyframe, Measurement, Odometry, Sighting, Transform, encode

SESSION = "session-0001"
COV_2 = (1e-4, 0.0, 1e-4)
COV_3 = (1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)


def hello(robot="r1", number=1, session=SESSION, site="site", kind="planar", **fields):
    return Hello(
        site=site, robot=robot, number=number, session=session, kind=kind, rig=None, **fields
    )


def keyframe(seq, robot="r1", session=SESSION, site="site", tag="6", x_m=1.0, **fields):
    odometry = Odometry(T_prev_cur=Transform(p_m=(0.1, 0.0), theta_rad=0.0), cov=COV_3)
    fields = {
        "t_ns": 1_000_000_000 + seq * 100_000_000,
        "odom": odometry if seq > 1 else None,
        "T_base_cam": Transform(p_m=(0.0, 0.0), theta_rad=0.0),
        "sightings": (
            Sighting(
                tag=tag,
                id_by="given",
                p_false=0.0,
                z=Measurement(point_cam_m=(x_m, 0.0), cov=COV_2),
            ),
        ),
        **fields,
    }
    return Keyframe(site=site, robot=robot, session=session, seq=seq, **fields)


def spatial_keyframe(seq, form="point_cam_m", **fields):
    z = {
        "point_cam_m": lambda: Measurement(
            point_cam_m=(1.0, 0.0, 2.0), cov=(1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)
        ),
        "mono_px": lambda: Measurement(mono_px=(1.0, 2.0), cov=COV_2),
    }[form]()
    return keyframe(
        seq,
        odom=None,
        T_base_cam=Transform(p_m=(0.0, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0)),
        sightings=(Sighting(tag="6", id_by="given", p_false=0.0, z=z),),
        **fields,
    )


__all__ = ["SESSION", "encode", "hello", "keyframe", "spatial_keyframe"]
