"""One view linearised at a pose: normal equations of the six unknowns, and their chi2.

The unknown is T_map_cam (3, 4), updated by T <- T @ exp(delta). Sighting i is a ray (4,), left
and right (x / z, y / z), with an information matrix Lambda (4, 4) whose rows are zero for a camera
that does not see it. With J = d ray / d p_cam,
    A = J^T Lambda J,    b = J^T Lambda r,    B = d p_cam / d delta = [-I, hat(p_cam)]
    H = sum B^T A B,     g = sum B^T b
A tag covariance S (cam axes) is noise of the point: by the matrix inversion lemma
    A <- (I + A S)^-1 A,    b <- (I + A S)^-1 b,    chi2 <- chi2 - b^T S (I + A S)^-1 b
"""

import math
from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.rigid import difference


class View(NamedTuple):
    """Tags seen from one place, as above; and what else is known of the pose.

    p (N, 3), ray (N, 4), information (N, 4, 4); cov (N, 3, 3) of the tags in map axes, (0, 3, 3)
    where they are exact; T_right_left (3, 4).
    prior_T (3, 4), prior_information (6, 6) of delta at prior_T: all zero where there is none.
    gravity (4,): the map's z axis as measured in cam, and 1 / rad^2; height (2,): of cam in the
    map, m and 1 / m^2.
    """

    p: Array
    ray: Array
    information: Array
    cov: Array
    T_right_left: Array
    prior_T: Array
    prior_information: Array
    gravity: Array
    height: Array


@compiled
def linearise(view: View, T: Array, H: Array, g: Array, scratch: Array) -> float:
    """Fill the lower triangle of H (6, 6), and g (6,), at T (3, 4); chi2.

    Infinite where a tag is behind its camera.
    """
    for i in range(6):
        g[i] = 0.0
        for j in range(i + 1):
            H[i, j] = 0.0
    p, rays, W, cov, M = view.p, view.ray, view.information, view.cov, view.T_right_left
    chi2 = 0.0
    uncertain = len(cov) > 0
    for i in range(len(p)):
        left, right = W[i, 0, 0] > 0.0, W[i, 2, 2] > 0.0
        if not (left or right):
            continue
        dx, dy, dz = p[i, 0] - T[0, 3], p[i, 1] - T[1, 3], p[i, 2] - T[2, 3]
        x = T[0, 0] * dx + T[1, 0] * dy + T[2, 0] * dz
        y = T[0, 1] * dx + T[1, 1] * dy + T[2, 1] * dz
        z = T[0, 2] * dx + T[1, 2] * dy + T[2, 2] * dz
        a00 = a01 = a02 = a11 = a12 = a22 = b0 = b1 = b2 = 0.0
        r0 = r1 = s = own = 0.0
        if left:
            if not z > 0.0:
                chi2 = math.inf
                break
            s = 1.0 / z
            u, v = x * s, y * s
            r0, r1 = rays[i, 0] - u, rays[i, 1] - v
            q0, q1 = W[i, 0, 0] * r0 + W[i, 0, 1] * r1, W[i, 0, 1] * r0 + W[i, 1, 1] * r1
            own = q0 * r0 + q1 * r1
            # J = s [[1, 0, -u], [0, 1, -v]]
            b0, b1, b2 = s * q0, s * q1, -s * (u * q0 + v * q1)
            ss = s * s
            a00, a01, a11 = ss * W[i, 0, 0], ss * W[i, 0, 1], ss * W[i, 1, 1]
            a02, a12 = -(a00 * u + a01 * v), -(a01 * u + a11 * v)
            a22 = -(a02 * u + a12 * v)
        if right:
            xr = M[0, 0] * x + M[0, 1] * y + M[0, 2] * z + M[0, 3]
            yr = M[1, 0] * x + M[1, 1] * y + M[1, 2] * z + M[1, 3]
            zr = M[2, 0] * x + M[2, 1] * y + M[2, 2] * z + M[2, 3]
            if not zr > 0.0:
                chi2 = math.inf
                break
            t = 1.0 / zr
            ur, vr = xr * t, yr * t
            r2, r3 = rays[i, 2] - ur, rays[i, 3] - vr
            q2, q3 = W[i, 2, 2] * r2 + W[i, 2, 3] * r3, W[i, 2, 3] * r2 + W[i, 3, 3] * r3
            c0, c1 = W[i, 0, 2] * r2 + W[i, 0, 3] * r3, W[i, 1, 2] * r2 + W[i, 1, 3] * r3
            own += q2 * r2 + q3 * r3 + 2.0 * (r0 * c0 + r1 * c1)
            e0, e1, e2 = t * (M[0, 0] - ur * M[2, 0]), t * (M[0, 1] - ur * M[2, 1]), 0.0
            e2 = t * (M[0, 2] - ur * M[2, 2])
            f0, f1 = t * (M[1, 0] - vr * M[2, 0]), t * (M[1, 1] - vr * M[2, 1])
            f2 = t * (M[1, 2] - vr * M[2, 2])
            q2 += W[i, 0, 2] * r0 + W[i, 1, 2] * r1
            q3 += W[i, 0, 3] * r0 + W[i, 1, 3] * r1
            b0 += e0 * q2 + f0 * q3
            b1 += e1 * q2 + f1 * q3
            b2 += e2 * q2 + f2 * q3
            w22, w23, w33 = W[i, 2, 2], W[i, 2, 3], W[i, 3, 3]
            h0, h1, h2 = w22 * e0 + w23 * f0, w22 * e1 + w23 * f1, w22 * e2 + w23 * f2
            k0, k1, k2 = w23 * e0 + w33 * f0, w23 * e1 + w33 * f1, w23 * e2 + w33 * f2
            a00 += e0 * h0 + f0 * k0
            a01 += e0 * h1 + f0 * k1
            a02 += e0 * h2 + f0 * k2
            a11 += e1 * h1 + f1 * k1
            a12 += e1 * h2 + f1 * k2
            a22 += e2 * h2 + f2 * k2
            if left and (
                W[i, 0, 2] != 0.0 or W[i, 0, 3] != 0.0 or W[i, 1, 2] != 0.0 or W[i, 1, 3] != 0.0
            ):
                b0 += s * c0
                b1 += s * c1
                u, v = x * s, y * s
                b2 -= s * (u * c0 + v * c1)
                m0, m1 = W[i, 0, 2] * e0 + W[i, 0, 3] * f0, W[i, 1, 2] * e0 + W[i, 1, 3] * f0
                n0, n1 = W[i, 0, 2] * e1 + W[i, 0, 3] * f1, W[i, 1, 2] * e1 + W[i, 1, 3] * f1
                o0, o1 = W[i, 0, 2] * e2 + W[i, 0, 3] * f2, W[i, 1, 2] * e2 + W[i, 1, 3] * f2
                a00 += 2.0 * s * m0
                a01 += s * (n0 + m1)
                a02 += s * (o0 - u * m0 - v * m1)
                a11 += 2.0 * s * n1
                a12 += s * (o1 - u * n0 - v * n1)
                a22 -= 2.0 * s * (u * o0 + v * o1)
        if uncertain:
            scratch[0, 0], scratch[0, 1], scratch[0, 2] = a00, a01, a02
            scratch[0, 3], scratch[0, 4], scratch[0, 5] = a11, a12, a22
            scratch[1, 0], scratch[1, 1], scratch[1, 2] = b0, b1, b2
            own = _soften(own, cov[i], T, scratch)
            a00, a01, a02 = scratch[0, 0], scratch[0, 1], scratch[0, 2]
            a11, a12, a22 = scratch[0, 3], scratch[0, 4], scratch[0, 5]
            b0, b1, b2 = scratch[1, 0], scratch[1, 1], scratch[1, 2]
        chi2 += own
        # A hat(p), then the lower right block by hat(p)^T from the left.
        m00, m01, m02 = a01 * z - a02 * y, a02 * x - a00 * z, a00 * y - a01 * x
        m10, m11, m12 = a11 * z - a12 * y, a12 * x - a01 * z, a01 * y - a11 * x
        m20, m21, m22 = a12 * z - a22 * y, a22 * x - a02 * z, a02 * y - a12 * x
        H[0, 0] += a00
        H[1, 0] += a01
        H[2, 0] += a02
        H[1, 1] += a11
        H[2, 1] += a12
        H[2, 2] += a22
        H[3, 0] -= m00
        H[3, 1] -= m10
        H[3, 2] -= m20
        H[4, 0] -= m01
        H[4, 1] -= m11
        H[4, 2] -= m21
        H[5, 0] -= m02
        H[5, 1] -= m12
        H[5, 2] -= m22
        H[3, 3] += z * m10 - y * m20
        H[4, 3] += x * m20 - z * m00
        H[5, 3] += y * m00 - x * m10
        H[4, 4] += x * m21 - z * m01
        H[5, 4] += y * m01 - x * m11
        H[5, 5] += y * m02 - x * m12
        g[0] -= b0
        g[1] -= b1
        g[2] -= b2
        g[3] += b1 * z - b2 * y
        g[4] += b2 * x - b0 * z
        g[5] += b0 * y - b1 * x
    return chi2 + _side_information(view, T, H, g, scratch)


@compiled
def _soften(chi2: float, cov: Array, T: Array, work: Array) -> float:
    """Apply a tag's covariance to A and b in the first two rows of `work`; the chi2 that is left.

    Of that d^T S d, with the new b called d, is the part that the tag takes: rounding never gets
    below it.
    """
    # S = R^T cov R in the rows 2, 3 of work, symmetric as A.
    for i in range(3):
        for j in range(3):
            s = 0.0
            for k in range(3):
                s += cov[i, k] * T[k, j]
            work[2 + i // 2, 3 * (i % 2) + j] = s
    k00, k01, k02 = work[2, 0], work[2, 1], work[2, 2]
    k10, k11, k12 = work[2, 3], work[2, 4], work[2, 5]
    k20, k21, k22 = work[3, 0], work[3, 1], work[3, 2]
    s00 = T[0, 0] * k00 + T[1, 0] * k10 + T[2, 0] * k20
    s01 = T[0, 0] * k01 + T[1, 0] * k11 + T[2, 0] * k21
    s02 = T[0, 0] * k02 + T[1, 0] * k12 + T[2, 0] * k22
    s11 = T[0, 1] * k01 + T[1, 1] * k11 + T[2, 1] * k21
    s12 = T[0, 1] * k02 + T[1, 1] * k12 + T[2, 1] * k22
    s22 = T[0, 2] * k02 + T[1, 2] * k12 + T[2, 2] * k22
    a00, a01, a02 = work[0, 0], work[0, 1], work[0, 2]
    a11, a12, a22 = work[0, 3], work[0, 4], work[0, 5]
    b0, b1, b2 = work[1, 0], work[1, 1], work[1, 2]
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
    work[0, 0] = (c00 * a00 + c01 * a01 + c02 * a02) / det
    work[0, 1] = (c00 * a01 + c01 * a11 + c02 * a12) / det
    work[0, 2] = (c00 * a02 + c01 * a12 + c02 * a22) / det
    work[0, 3] = (c10 * a01 + c11 * a11 + c12 * a12) / det
    work[0, 4] = (c10 * a02 + c11 * a12 + c12 * a22) / det
    work[0, 5] = (c20 * a02 + c21 * a12 + c22 * a22) / det
    work[1, 0], work[1, 1], work[1, 2] = d0, d1, d2
    e0, e1 = s00 * d0 + s01 * d1 + s02 * d2, s01 * d0 + s11 * d1 + s12 * d2
    e2 = s02 * d0 + s12 * d1 + s22 * d2
    taken: float = d0 * e0 + d1 * e1 + d2 * e2
    left: float = chi2 - (b0 * e0 + b1 * e1 + b2 * e2)
    return max(left, taken)


@compiled
def _side_information(view: View, T: Array, H: Array, g: Array, scratch: Array) -> float:
    """Add prior pose, gravity and height; their chi2."""
    chi2 = 0.0
    w = view.gravity[3]
    if w > 0.0:
        # The map's z axis in cam turns by exp(-omega).
        x, y, z = T[2, 0], T[2, 1], T[2, 2]
        ex, ey, ez = view.gravity[0] - x, view.gravity[1] - y, view.gravity[2] - z
        chi2 += w * (ex * ex + ey * ey + ez * ez)
        H[3, 3] += w * (y * y + z * z)
        H[4, 4] += w * (x * x + z * z)
        H[5, 5] += w * (x * x + y * y)
        H[4, 3] -= w * x * y
        H[5, 3] -= w * x * z
        H[5, 4] -= w * y * z
        g[3] += w * (z * ey - y * ez)
        g[4] += w * (x * ez - z * ex)
        g[5] += w * (y * ex - x * ey)
    w = view.height[1]
    if w > 0.0:
        e = view.height[0] - T[2, 3]
        chi2 += w * e * e
        for i in range(3):
            g[i] += w * e * T[2, i]
            for j in range(i + 1):
                H[i, j] += w * T[2, i] * T[2, j]
    P = view.prior_information
    if P[0, 0] > 0.0 or P[1, 1] > 0.0 or P[2, 2] > 0.0 or P[3, 3] > 0.0:
        chi2 += _prior(view.prior_T, P, T, H, g, scratch)
    return chi2


@compiled
def _prior(prior_T: Array, P: Array, T: Array, H: Array, g: Array, work: Array) -> float:
    """d = log(prior_T^-1 T) ~ N(0, P^-1), with the right Jacobian's inverse to second order."""
    J, d, PJ = np.zeros((6, 6)), np.empty(6), np.empty((6, 6))
    difference(prior_T, T, d)
    ad = work
    ad[:] = 0.0
    for block in range(2):
        o = 3 * block
        ad[o, o + 1], ad[o, o + 2], ad[o + 1, o + 2] = -d[5], d[4], -d[3]
        ad[o + 1, o], ad[o + 2, o], ad[o + 2, o + 1] = d[5], -d[4], d[3]
    ad[0, 4], ad[0, 5], ad[1, 5] = -d[2], d[1], -d[0]
    ad[1, 3], ad[2, 3], ad[2, 4] = d[2], -d[1], d[0]
    for i in range(6):
        for j in range(6):
            s = 0.0
            for k in range(6):
                s += ad[i, k] * ad[k, j]
            J[i, j] = (1.0 if i == j else 0.0) + 0.5 * ad[i, j] + s / 12.0
    chi2 = 0.0
    for i in range(6):
        for j in range(6):
            s = 0.0
            for k in range(6):
                s += P[i, k] * J[k, j]
            PJ[i, j] = s
            chi2 += d[i] * P[i, j] * d[j]
    for i in range(6):
        for k in range(6):
            g[i] -= PJ[k, i] * d[k]
            for j in range(i + 1):
                H[i, j] += J[k, i] * PJ[k, j]
    return chi2
