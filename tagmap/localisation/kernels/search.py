"""All poses that explain one view, best first: starts, refinement, and what to doubt.

Starts: weighted rigid alignment of triangulated points where three tags are seen by both cameras;
all roots of P3P on a wide triple (a ray of the right camera counts as one of the left: good enough
to start from); the prior pose.
"""

import math
from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels import normal
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.rigid import align, copy, difference, exp_update, orthonormalise
from tagmap.localisation.kernels import p3p
from tagmap.localisation.kernels.refine import Desk, mahalanobis, new_desk, refine, weakest
from tagmap.localisation.kernels.scene import View, linearise
from tagmap.localisation.view import ALIVE_CHI2

ROOTS = 4

# Flags; what they mean is said in tagmap.localisation.pose.
FEW = 1
COLLINEAR = 2
NO_ROOT = 4
AMBIGUOUS = 8
CURVED = 16
SINGULAR = 32
MISFIT = 64

_TRIPLES = 3
# chi2 of a P3P root, which explains one triple in one image exactly, can fall this far.
_WITHIN_REACH = 2000.0
_SAME_POSE = 1.0
_NEAR_CHI2 = 400.0
_COLLINEAR_SHARE = 1e-3
_LINEAR_SIGMAS = 3.0
_LINEAR_SHARE = 0.35
_STRAIGHT = 0.002
_MOST_SIGMA = 0.25
_UNSEEN = -3.0


class Room(NamedTuple):
    """Scratch of a search: all arrays that it writes."""

    T: Array
    chi2: Array
    H: Array
    starts: Array
    T_now: Array
    seen: Array
    weight: Array
    triangle: Array
    corners: Array
    distances: Array
    frames: Array
    xi: Array
    step: Array


@compiled
def new_room(n: int) -> Room:
    return Room(
        np.zeros((ROOTS, 3, 4)),
        np.zeros(ROOTS),
        np.zeros((ROOTS, 6, 6)),
        np.zeros((ROOTS, 3, 4)),
        np.zeros((3, 4)),
        np.zeros((n, 3)),
        np.zeros(n),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((4, 3)),
        np.zeros((2, 3, 3)),
        np.zeros(6),
        np.zeros(6),
    )


@compiled
def search(
    view: View, chi2_bound: Array, room: Room, desk: Desk, cov: Array
) -> tuple[int, int, int]:
    """Number of poses found, degrees of freedom, flags. Poses are in room.T, best first, with
    room.chi2; cov (6, 6) is the best one's. chi2_bound (k,), by degrees of freedom.
    """
    rows, tags = _count(view)
    dof = rows - 6
    known = _knows_pose(view)
    flags = 0
    if tags < 3:
        flags |= FEW
    elif _is_collinear(view, room):
        flags |= COLLINEAR
    if dof < 0 or (flags != 0 and not known):
        return 0, dof, flags if flags != 0 else SINGULAR
    n = 0
    if known:
        copy(view.prior_T, room.T_now)
        n = _add(view, room, desk, n)
    if (
        tags >= 3
        and _triangulated(view, room) >= 3
        and align(room.seen, view.p, room.weight, room.T_now)
    ):
        n = _add(view, room, desk, n)
    if tags >= 3:
        n = _from_triples(view, room, desk, n, chi2_bound[min(dof, len(chi2_bound) - 1)], dof)
    if n == 0:
        return 0, dof, flags | NO_ROOT
    flags |= _judge(view, room, desk, n, cov)
    if dof > 0 and room.chi2[0] > chi2_bound[min(dof, len(chi2_bound) - 1)]:
        flags |= MISFIT
    alive = 1
    while alive < n and room.chi2[alive] < room.chi2[0] + ALIVE_CHI2:
        alive += 1
    if alive > 1:
        flags |= AMBIGUOUS
    return alive, dof, flags


@compiled
def _count(view: View) -> tuple[int, int]:
    rows = tags = 0
    for i in range(len(view.p)):
        left, right = view.information[i, 0, 0] > 0.0, view.information[i, 2, 2] > 0.0
        tags += 1 if left or right else 0
        rows += (2 if left else 0) + (2 if right else 0)
    rows += 2 if view.gravity[3] > 0.0 else 0
    rows += 1 if view.height[1] > 0.0 else 0
    for i in range(6):
        rows += 1 if view.prior_information[i, i] > 0.0 else 0
    return rows, tags


@compiled
def _knows_pose(view: View) -> bool:
    rank = 0
    for i in range(6):
        rank += 1 if view.prior_information[i, i] > 0.0 else 0
    return rank == 6


@compiled
def _is_collinear(view: View, room: Room) -> bool:
    """Whether the tags lie on one line to a thousandth of its length."""
    used = room.weight
    first = -1
    far, base = 0.0, -1
    for i in range(len(view.p)):
        used[i] = view.information[i, 0, 0] + view.information[i, 2, 2]
        if used[i] > 0.0 and first < 0:
            first = i
    for i in range(len(view.p)):
        if used[i] > 0.0:
            x, y, z = _between(view.p, first, i)
            square = x * x + y * y + z * z
            if square > far:
                far, base = square, i
    if base < 0:
        return True
    x, y, z = _between(view.p, first, base)
    for i in range(len(view.p)):
        if used[i] > 0.0:
            u, v, w = _between(view.p, first, i)
            a, b, c = y * w - z * v, z * u - x * w, x * v - y * u
            if a * a + b * b + c * c > (_COLLINEAR_SHARE * far) ** 2:
                return False
    return True


@compiled
def _between(p: Array, i: int, j: int) -> tuple[float, float, float]:
    return p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]


@compiled
def _triangulated(view: View, room: Room) -> int:
    """Points in room.seen (N, 3) where the rays of a stereo pair come closest, weights in
    room.weight by the variance of their depth, z^-4; zero where there is no pair."""
    M = view.T_right_left
    found = 0
    for i in range(len(view.p)):
        room.weight[i] = 0.0
        if not (view.information[i, 0, 0] > 0.0 and view.information[i, 2, 2] > 0.0):
            continue
        x, y = view.ray[i, 0], view.ray[i, 1]
        u, v = view.ray[i, 2], view.ray[i, 3]
        a = M[0, 0] * x + M[0, 1] * y + M[0, 2]
        b = M[1, 0] * x + M[1, 1] * y + M[1, 2]
        c = M[2, 0] * x + M[2, 1] * y + M[2, 2]
        aa, rr, ar = a * a + b * b + c * c, u * u + v * v + 1.0, a * u + b * v + c
        at = a * M[0, 3] + b * M[1, 3] + c * M[2, 3]
        rt = u * M[0, 3] + v * M[1, 3] + M[2, 3]
        z = (ar * rt - rr * at) / (aa * rr - ar * ar)
        if z > 0.0 and z < math.inf:
            room.seen[i, 0], room.seen[i, 1], room.seen[i, 2] = x * z, y * z, z
            room.weight[i] = 1.0 / (z * z * z * z)
            found += 1
    return found


@compiled
def _from_triples(view: View, room: Room, desk: Desk, n: int, bound: float, dof: int) -> int:
    """Add the roots of a wide triple, and of further ones while nothing explains the view."""
    skip = -1
    explained = n > 0 and room.chi2[0] < bound
    for _ in range(_TRIPLES):
        chosen = _triple(view, room, skip)
        if chosen < 0:
            break
        # Two roots that noise has merged and lifted off the real line still mark a pose nearby.
        roots = p3p.poses(
            room.triangle, room.corners, True, room.distances, room.frames, room.starts
        )
        own = _root_of_best(room, roots) if explained else -1
        for k in range(roots):
            if k == own:
                continue
            copy(room.starts[k], room.T_now)
            if explained:
                chi2 = linearise(view, room.T_now, desk.trial_H, desk.trial_g, desk.scratch)
                if chi2 > room.chi2[0] + _WITHIN_REACH:
                    continue
            n = _add(view, room, desk, n)
        if n > 0 and (dof == 0 or room.chi2[0] < bound):
            break
        skip = chosen
    return n


@compiled
def _root_of_best(room: Room, roots: int) -> int:
    """The start that belongs to the best pose found so far: the nearest, if it is near; or -1."""
    nearest, least = -1, _NEAR_CHI2
    for k in range(roots):
        difference(room.T[0], room.starts[k], room.xi)
        apart = mahalanobis(room.H[0], room.xi)
        if apart < least:
            nearest, least = k, apart
    return nearest


@compiled
def _triple(view: View, room: Room, skip: int) -> int:
    """Unit rays of a triple, as far apart as a greedy choice finds, in room.triangle, its tags in
    room.corners; its last tag, or -1. Tag `skip` stays out."""
    rays, p = room.seen, view.p
    first = _unit_rays(view, rays, skip)
    second = _furthest(rays, first)
    first = _furthest(rays, second)
    third, widest = -1, 0.0
    for i in range(len(p)):
        if i != first and i != second and rays[i, 2] > _UNSEEN:
            volume = _area(rays, first, second, i) * _area(p, first, second, i)
            if volume > widest:
                widest, third = volume, i
    if third >= 0:
        for k in range(3):
            room.triangle[0, k], room.corners[0, k] = rays[first, k], p[first, k]
            room.triangle[1, k], room.corners[1, k] = rays[second, k], p[second, k]
            room.triangle[2, k], room.corners[2, k] = rays[third, k], p[third, k]
    return third


@compiled
def _unit_rays(view: View, rays: Array, skip: int) -> int:
    """Unit rays (N, 3) in cam; z = _UNSEEN for tags that no camera sees, and for `skip`. A tag
    that has one."""
    seen, M, W = view.ray, view.T_right_left, view.information
    some = 0
    for i in range(len(seen)):
        rays[i, 2] = _UNSEEN
        if i == skip:
            continue
        if W[i, 0, 0] > 0.0:
            x, y, z = seen[i, 0], seen[i, 1], 1.0
        elif W[i, 2, 2] > 0.0:
            u, v = seen[i, 2], seen[i, 3]
            x = M[0, 0] * u + M[1, 0] * v + M[2, 0]
            y = M[0, 1] * u + M[1, 1] * v + M[2, 1]
            z = M[0, 2] * u + M[1, 2] * v + M[2, 2]
        else:
            continue
        inverse = 1.0 / math.sqrt(x * x + y * y + z * z)
        rays[i, 0], rays[i, 1], rays[i, 2] = x * inverse, y * inverse, z * inverse
        some = i
    return some


@compiled
def _furthest(rays: Array, base: int) -> int:
    other, widest = base, -1.0
    for i in range(len(rays)):
        if i != base and rays[i, 2] > _UNSEEN:
            x, y, z = _between(rays, base, i)
            square = x * x + y * y + z * z
            if square > widest:
                other, widest = i, square
    return other


@compiled
def _area(p: Array, i: int, j: int, k: int) -> float:
    """Squared area, times four."""
    x, y, z = _between(p, i, j)
    u, v, w = _between(p, i, k)
    a, b, c = y * w - z * v, z * u - x * w, x * v - y * u
    return a * a + b * b + c * c


@compiled
def _add(view: View, room: Room, desk: Desk, n: int) -> int:
    """Refine room.T_now and sort it in, unless it leads to a pose that is there; their number."""
    chi2 = refine(view, room.T_now, desk)
    if not chi2 < math.inf:
        return n
    for k in range(n):
        difference(room.T[k], room.T_now, room.xi)
        if (
            mahalanobis(desk.H, room.xi) < _SAME_POSE
            or mahalanobis(room.H[k], room.xi) < _SAME_POSE
        ):
            return n
    if n == ROOTS and chi2 >= room.chi2[ROOTS - 1]:
        return n
    at = min(n, ROOTS - 1)
    while at > 0 and room.chi2[at - 1] > chi2:
        room.chi2[at] = room.chi2[at - 1]
        copy(room.T[at - 1], room.T[at])
        copy(room.H[at - 1], room.H[at])
        at -= 1
    room.chi2[at] = chi2
    copy(room.T_now, room.T[at])
    copy(desk.H, room.H[at])
    return min(n + 1, ROOTS)


@compiled
def _judge(view: View, room: Room, desk: Desk, n: int, cov: Array) -> int:
    """Covariance of the best pose, and the flags that say it is not one to rely on."""
    for k in range(n):
        orthonormalise(room.T[k])
    H = room.H[0]
    if not normal.factor(H, 0.0, desk.L):
        cov[:] = np.nan
        return SINGULAR
    normal.inverse(desk.L, desk.scratch, cov)
    near, far = math.inf, 0.0
    for i in range(len(view.p)):
        if view.information[i, 0, 0] + view.information[i, 2, 2] > 0.0:
            square = 0.0
            for k in range(3):
                square += (view.p[i, k] - room.T[0, k, 3]) ** 2
            near, far = min(near, square), max(far, square)
    near, far = math.sqrt(near), math.sqrt(far)
    variance = cov[0, 0] + cov[1, 1] + cov[2, 2]
    turn = cov[3, 3] + cov[4, 4] + cov[5, 5]
    if not max(variance, turn * near * near) < (_MOST_SIGMA * near) ** 2:
        return CURVED
    if max(variance, turn * near * near) < (_STRAIGHT * near) ** 2:
        return 0
    return 0 if _is_linear(view, room, desk, cov, far) else CURVED


@compiled
def _is_linear(view: View, room: Room, desk: Desk, cov: Array, lever_m: float) -> bool:
    """Three sigmas either way along the weakest direction chi2 must rise by about nine."""
    weakest(cov, lever_m, room.step, room.xi)
    for side in range(2):
        for i in range(6):
            room.xi[i] = (1.0 - 2.0 * side) * _LINEAR_SIGMAS * room.step[i]
        exp_update(room.T[0], room.xi, room.T_now)
        chi2 = linearise(view, room.T_now, desk.trial_H, desk.trial_g, desk.scratch)
        share = (chi2 - room.chi2[0]) / _LINEAR_SIGMAS**2
        if not abs(share - 1.0) < _LINEAR_SHARE:
            return False
    return True


@compiled
def batch(
    p: Array,
    ray: Array,
    information: Array,
    cov_map: Array,
    T_right_left: Array,
    prior_T: Array,
    prior_information: Array,
    gravity: Array,
    height: Array,
    chi2_bound: Array,
    T: Array,
    cov: Array,
    chi2: Array,
    counts: Index,
) -> None:
    """`search` for S views: p (S, N, 3), ... in; T (S, 4, 3, 4), cov (S, 6, 6), chi2 (S, 4),
    counts (S, 3) of poses, degrees of freedom, flags out. A first axis of 1: alike in all views.
    """
    room, desk = new_room(p.shape[1]), new_desk()
    for s in range(len(ray)):
        view = View(
            p[s % len(p)],
            ray[s],
            information[s % len(information)],
            cov_map[s % len(cov_map)],
            T_right_left,
            prior_T[s % len(prior_T)],
            prior_information[s % len(prior_information)],
            gravity[s % len(gravity)],
            height[s % len(height)],
        )
        found, dof, flags = search(view, chi2_bound, room, desk, cov[s])
        T[s], chi2[s] = room.T, room.chi2
        counts[s, 0], counts[s, 1], counts[s, 2] = found, dof, flags
