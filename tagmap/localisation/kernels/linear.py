"""One view linearised at a pose: normal equations of the six unknowns, and their chi2.

The unknown is T_map_cam, updated by T <- T @ exp(step). Of a sighting with the information Lambda
(4, 4) of its ray, and J = d ray / d p_cam,
    A = J^T Lambda J,    b = J^T Lambda r,    B = d p_cam / d step = [-I, hat(p_cam)]
    H = sum B^T A B,     g = sum B^T b
A tag covariance S (cam axes) is noise of the point: by the matrix inversion lemma
    A <- (I + A S)^-1 A,    b <- (I + A S)^-1 b,    chi2 <- chi2 - b^T S (I + A S)^-1 b
"""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.motion import Pose, Step
from tagmap.localisation.kernels.sightings import COV, CROSS, LEFT, RAY, RIGHT, P
from tagmap.localisation.kernels.square import Square

Terms = tuple[
    float, float, float, float, float, float, float, float, float, float
]  # fmt: skip


@compiled
def normal_equations(
    rows: Array, n: int, soft: bool, rig: Pose, T: Pose
) -> tuple[float, Square, Step]:
    """chi2, H and g at T of the first n rows; chi2 is infinite where a tag is behind its camera.

    soft: tags have covariances. rig: T_right_left.
    """
    chi2, behind = 0.0, False
    h00 = h10 = h11 = h20 = h21 = h22 = h30 = h31 = h32 = h33 = h40 = 0.0
    h41 = h42 = h43 = h44 = h50 = h51 = h52 = h53 = h54 = h55 = 0.0
    g0 = g1 = g2 = g3 = g4 = g5 = 0.0
    for i in range(n):
        dx, dy, dz = rows[i, P] - T[3], rows[i, P + 1] - T[7], rows[i, P + 2] - T[11]
        x = T[0] * dx + T[4] * dy + T[8] * dz
        y = T[1] * dx + T[5] * dy + T[9] * dz
        z = T[2] * dx + T[6] * dy + T[10] * dz
        a00 = a01 = a02 = a11 = a12 = a22 = b0 = b1 = b2 = 0.0
        r0 = r1 = s = u = v = own = 0.0
        w00, w22 = rows[i, LEFT], rows[i, RIGHT]
        if w00 > 0.0:
            behind = behind or not z > 0.0
            w01, w11 = rows[i, LEFT + 1], rows[i, LEFT + 2]
            s = 1.0 / z
            u, v = x * s, y * s
            r0, r1 = rows[i, RAY] - u, rows[i, RAY + 1] - v
            q0, q1 = w00 * r0 + w01 * r1, w01 * r0 + w11 * r1
            own += q0 * r0 + q1 * r1
            # J = s [[1, 0, -u], [0, 1, -v]]
            b0, b1, b2 = s * q0, s * q1, -s * (u * q0 + v * q1)
            ss = s * s
            a00, a01, a11 = ss * w00, ss * w01, ss * w11
            a02, a12 = -(a00 * u + a01 * v), -(a01 * u + a11 * v)
            a22 = -(a02 * u + a12 * v)
        if w22 > 0.0:
            w23, w33 = rows[i, RIGHT + 1], rows[i, RIGHT + 2]
            zr = rig[8] * x + rig[9] * y + rig[10] * z + rig[11]
            behind = behind or not zr > 0.0
            t = 1.0 / zr
            ur = (rig[0] * x + rig[1] * y + rig[2] * z + rig[3]) * t
            vr = (rig[4] * x + rig[5] * y + rig[6] * z + rig[7]) * t
            r2, r3 = rows[i, RAY + 2] - ur, rows[i, RAY + 3] - vr
            q2, q3 = w22 * r2 + w23 * r3, w23 * r2 + w33 * r3
            own += q2 * r2 + q3 * r3
            e0, e1 = t * (rig[0] - ur * rig[8]), t * (rig[1] - ur * rig[9])
            e2 = t * (rig[2] - ur * rig[10])
            f0, f1 = t * (rig[4] - vr * rig[8]), t * (rig[5] - vr * rig[9])
            f2 = t * (rig[6] - vr * rig[10])
            x02, x03, x12, x13 = (
                rows[i, CROSS], rows[i, CROSS + 1], rows[i, CROSS + 2], rows[i, CROSS + 3]
            )  # fmt: skip
            if x02 != 0.0 or x03 != 0.0 or x12 != 0.0 or x13 != 0.0:
                c0, c1 = x02 * r2 + x03 * r3, x12 * r2 + x13 * r3
                own += 2.0 * (r0 * c0 + r1 * c1)
                q2 += x02 * r0 + x12 * r1
                q3 += x03 * r0 + x13 * r1
                b0 += s * c0
                b1 += s * c1
                b2 -= s * (u * c0 + v * c1)
                m0, m1 = x02 * e0 + x03 * f0, x12 * e0 + x13 * f0
                n0, n1 = x02 * e1 + x03 * f1, x12 * e1 + x13 * f1
                o0, o1 = x02 * e2 + x03 * f2, x12 * e2 + x13 * f2
                a00 += 2.0 * s * m0
                a01 += s * (n0 + m1)
                a02 += s * (o0 - u * m0 - v * m1)
                a11 += 2.0 * s * n1
                a12 += s * (o1 - u * n0 - v * n1)
                a22 -= 2.0 * s * (u * o0 + v * o1)
            b0 += e0 * q2 + f0 * q3
            b1 += e1 * q2 + f1 * q3
            b2 += e2 * q2 + f2 * q3
            d0, d1, d2 = w22 * e0 + w23 * f0, w22 * e1 + w23 * f1, w22 * e2 + w23 * f2
            k0, k1, k2 = w23 * e0 + w33 * f0, w23 * e1 + w33 * f1, w23 * e2 + w33 * f2
            a00 += e0 * d0 + f0 * k0
            a01 += e0 * d1 + f0 * k1
            a02 += e0 * d2 + f0 * k2
            a11 += e1 * d1 + f1 * k1
            a12 += e1 * d2 + f1 * k2
            a22 += e2 * d2 + f2 * k2
        if soft:
            terms = (a00, a01, a02, a11, a12, a22, b0, b1, b2, own)
            a00, a01, a02, a11, a12, a22, b0, b1, b2, own = _soften(terms, rows, i, T)
        chi2 += own
        # A hat(p), then the lower right block by hat(p)^T from the left.
        m00, m01, m02 = a01 * z - a02 * y, a02 * x - a00 * z, a00 * y - a01 * x
        m10, m11, m12 = a11 * z - a12 * y, a12 * x - a01 * z, a01 * y - a11 * x
        m20, m21, m22 = a12 * z - a22 * y, a22 * x - a02 * z, a02 * y - a12 * x
        h00 += a00
        h10 += a01
        h11 += a11
        h20 += a02
        h21 += a12
        h22 += a22
        h30 -= m00
        h31 -= m10
        h32 -= m20
        h33 += z * m10 - y * m20
        h40 -= m01
        h41 -= m11
        h42 -= m21
        h43 += x * m20 - z * m00
        h44 += x * m21 - z * m01
        h50 -= m02
        h51 -= m12
        h52 -= m22
        h53 += y * m00 - x * m10
        h54 += y * m01 - x * m11
        h55 += y * m02 - x * m12
        g0 -= b0
        g1 -= b1
        g2 -= b2
        g3 += b1 * z - b2 * y
        g4 += b2 * x - b0 * z
        g5 += b0 * y - b1 * x
    H = (
        h00,
        h10, h11,
        h20, h21, h22,
        h30, h31, h32, h33,
        h40, h41, h42, h43, h44,
        h50, h51, h52, h53, h54, h55,
    )  # fmt: skip
    return math.inf if behind else chi2, H, (g0, g1, g2, g3, g4, g5)


@compiled
def _soften(terms: Terms, rows: Array, i: int, T: Pose) -> Terms:
    """A (upper triangle), b and chi2 of a tag that has a covariance.

    Of the chi2 that is left d^T S d, with the new b called d, is the part that the tag takes:
    rounding never gets below it.
    """
    a00, a01, a02, a11, a12, a22, b0, b1, b2, chi2 = terms
    t00, t01, t02 = rows[i, COV], rows[i, COV + 1], rows[i, COV + 2]
    t11, t12, t22 = rows[i, COV + 3], rows[i, COV + 4], rows[i, COV + 5]
    # S = R^T cov R.
    k00, k10, k20 = (
        t00 * T[0] + t01 * T[4] + t02 * T[8],
        t01 * T[0] + t11 * T[4] + t12 * T[8],
        t02 * T[0] + t12 * T[4] + t22 * T[8],
    )
    k01, k11, k21 = (
        t00 * T[1] + t01 * T[5] + t02 * T[9],
        t01 * T[1] + t11 * T[5] + t12 * T[9],
        t02 * T[1] + t12 * T[5] + t22 * T[9],
    )
    k02, k12, k22 = (
        t00 * T[2] + t01 * T[6] + t02 * T[10],
        t01 * T[2] + t11 * T[6] + t12 * T[10],
        t02 * T[2] + t12 * T[6] + t22 * T[10],
    )
    s00 = T[0] * k00 + T[4] * k10 + T[8] * k20
    s01 = T[0] * k01 + T[4] * k11 + T[8] * k21
    s02 = T[0] * k02 + T[4] * k12 + T[8] * k22
    s11 = T[1] * k01 + T[5] * k11 + T[9] * k21
    s12 = T[1] * k02 + T[5] * k12 + T[9] * k22
    s22 = T[2] * k02 + T[6] * k12 + T[10] * k22
    q00 = 1.0 + a00 * s00 + a01 * s01 + a02 * s02
    q01, q02 = a00 * s01 + a01 * s11 + a02 * s12, a00 * s02 + a01 * s12 + a02 * s22
    q10, q12 = a01 * s00 + a11 * s01 + a12 * s02, a01 * s02 + a11 * s12 + a12 * s22
    q11 = 1.0 + a01 * s01 + a11 * s11 + a12 * s12
    q20, q21 = a02 * s00 + a12 * s01 + a22 * s02, a02 * s01 + a12 * s11 + a22 * s12
    q22 = 1.0 + a02 * s02 + a12 * s12 + a22 * s22
    c00, c01, c02 = q11 * q22 - q12 * q21, q02 * q21 - q01 * q22, q01 * q12 - q02 * q11
    c10, c11, c12 = q12 * q20 - q10 * q22, q00 * q22 - q02 * q20, q02 * q10 - q00 * q12
    c20, c21, c22 = q10 * q21 - q11 * q20, q01 * q20 - q00 * q21, q00 * q11 - q01 * q10
    det = q00 * c00 + q01 * c10 + q02 * c20
    d0 = (c00 * b0 + c01 * b1 + c02 * b2) / det
    d1 = (c10 * b0 + c11 * b1 + c12 * b2) / det
    d2 = (c20 * b0 + c21 * b1 + c22 * b2) / det
    e0, e1 = s00 * d0 + s01 * d1 + s02 * d2, s01 * d0 + s11 * d1 + s12 * d2
    e2 = s02 * d0 + s12 * d1 + s22 * d2
    taken = d0 * e0 + d1 * e1 + d2 * e2
    left = chi2 - (b0 * e0 + b1 * e1 + b2 * e2)
    return (
        (c00 * a00 + c01 * a01 + c02 * a02) / det,
        (c00 * a01 + c01 * a11 + c02 * a12) / det,
        (c00 * a02 + c01 * a12 + c02 * a22) / det,
        (c10 * a01 + c11 * a11 + c12 * a12) / det,
        (c10 * a02 + c11 * a12 + c12 * a22) / det,
        (c20 * a02 + c21 * a12 + c22 * a22) / det,
        d0,
        d1,
        d2,
        max(left, taken),
    )


@compiled
def cost(rows: Array, n: int, rig: Pose, T: Pose) -> float:
    """chi2 at T of the first n rows, tags exact; infinite where one is behind its camera."""
    chi2, behind = 0.0, False
    for i in range(n):
        dx, dy, dz = rows[i, P] - T[3], rows[i, P + 1] - T[7], rows[i, P + 2] - T[11]
        x = T[0] * dx + T[4] * dy + T[8] * dz
        y = T[1] * dx + T[5] * dy + T[9] * dz
        z = T[2] * dx + T[6] * dy + T[10] * dz
        r0 = r1 = 0.0
        if rows[i, LEFT] > 0.0:
            behind = behind or not z > 0.0
            r0, r1 = rows[i, RAY] - x / z, rows[i, RAY + 1] - y / z
            chi2 += rows[i, LEFT] * r0 * r0 + rows[i, LEFT + 2] * r1 * r1
            chi2 += 2.0 * rows[i, LEFT + 1] * r0 * r1
        if rows[i, RIGHT] > 0.0:
            zr = rig[8] * x + rig[9] * y + rig[10] * z + rig[11]
            behind = behind or not zr > 0.0
            r2 = rows[i, RAY + 2] - (rig[0] * x + rig[1] * y + rig[2] * z + rig[3]) / zr
            r3 = rows[i, RAY + 3] - (rig[4] * x + rig[5] * y + rig[6] * z + rig[7]) / zr
            chi2 += rows[i, RIGHT] * r2 * r2 + rows[i, RIGHT + 2] * r3 * r3
            chi2 += 2.0 * rows[i, RIGHT + 1] * r2 * r3
            chi2 += 2.0 * r0 * (rows[i, CROSS] * r2 + rows[i, CROSS + 1] * r3)
            chi2 += 2.0 * r1 * (rows[i, CROSS + 2] * r2 + rows[i, CROSS + 3] * r3)
    return math.inf if behind else chi2
