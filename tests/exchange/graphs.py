"""Worlds a person can picture, as graph files: a ring road with landmarks beside it."""

import numpy as np

from tagmap.geometry import se2, se3

CORNERS = 12


def planar(n=40, tags=CORNERS, seed=0, sigma=0.0):
    """Lines of vertices and of edges, and the truth (T (n, 3, 3), p (tags, 2)).

    Steps have information 1e4 (1e6 in heading), landmarks 1e2, and errors of `sigma` times that.
    """
    rng = np.random.default_rng(seed)
    turn = se2.from_p_theta(np.array([0.5, 0.02]), 2.0 * np.pi / n)
    T = np.stack([np.linalg.matrix_power(turn, i) for i in range(n)])
    p = 6.0 * rng.normal(size=(tags, 2))
    vertices = [f"VERTEX_SE2 {i} {row(*T[i, :2, 2], heading(T[i]))}" for i in range(n)]
    vertices += [f"VERTEX_XY {n + j} {row(*p[j])}" for j in range(tags)]
    edges = []
    for i in range(n - 1):
        noise = sigma * rng.normal(size=3) * [1e-2, 1e-2, 1e-3]
        Z = se2.inverse(T[i]) @ T[i + 1] @ se2.exp(noise)
        edges.append(f"EDGE_SE2 {i} {i + 1} {row(*Z[:2, 2], heading(Z))} 1e4 0 0 1e4 0 1e6")
    for i in range(n):
        for j in range(tags):
            z = se2.act(se2.inverse(T[i]), p[j]) + sigma * 0.1 * rng.normal(size=2)
            edges.append(f"EDGE_SE2_XY {i} {n + j} {row(*z)} 1e2 0 1e2")
    return vertices, edges, (T, p)


def spatial(n=12, tags=8, seed=0, sigma=0.0):
    """The same in space, seen by a camera that is not at the origin of base."""
    rng = np.random.default_rng(seed)
    turn = se3.exp(np.array([0.5, 0.0, 0.05, 0.02, 0.0, 0.2]))
    T = np.stack([np.linalg.matrix_power(turn, i) for i in range(n)])
    p = 4.0 * rng.normal(size=(tags, 3))
    mount = se3.exp(np.array([0.1, 0.2, 0.3, 0.4, -0.5, 0.6]))
    lines = [f"PARAMS_SE3OFFSET 7 {row(*xyzq(mount))}"]
    lines += [f"VERTEX_SE3:QUAT {i} {row(*xyzq(T[i]))}" for i in range(n)]
    lines += [f"VERTEX_TRACKXYZ {n + j} {row(*p[j])}" for j in range(tags)]
    edges = []
    step = " ".join(map(str, np.diag([1e4] * 3 + [1e6] * 3)[np.triu_indices(6)]))
    for i in range(n - 1):
        noise = sigma * rng.normal(size=6) * [1e-2, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3]
        Z = se3.inverse(T[i]) @ T[i + 1] @ se3.exp(noise)
        edges.append(f"EDGE_SE3:QUAT {i} {i + 1} {row(*xyzq(Z))} {step}")
    for i in range(n):
        for j in range(tags):
            z = se3.act(se3.inverse(T[i] @ mount), p[j]) + sigma * 0.1 * rng.normal(size=3)
            edges.append(f"EDGE_SE3_TRACKXYZ {i} {n + j} 7 {row(*z)} 1e2 0 0 1e2 0 1e2")
    return lines, edges, (T, p)


def row(*numbers):
    return " ".join(repr(float(x)) for x in numbers)


def heading(T):
    return float(se2.to_p_theta(T)[1])


def xyzq(T):
    p, q = se3.to_p_q(T)
    return [*p, *q[1:], q[0]]


def write(path, *parts):
    path.write_text("\n".join(line for part in parts for line in part) + "\n")
    return path
