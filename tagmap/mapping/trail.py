"""What a robot did since its last solved keyframe: steps, and the poses that are known of them."""

from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Index, Kind
from tagmap.geometry.covariance import pack_upper, unpack_upper
from tagmap.localisation.kernels import carrying
from tagmap.mapping.past import Moment
from tagmap.records import Keyframe
from tagmap.records.arrays import matrix

MOST = 4096
FIRST = 64
_BY_ODOMETRY, _KNOWN, _LOST = 0, 1, 2


class Trail:
    """Keyframes in the order of seq; more than `MOST` and the oldest are forgotten.

    seq, t_ns (n,); T_step (n, D, D) and cov_step (n, dof, dof) to each from the one before it, as
    the robot states them; whole (n,): False where nothing is known of that step.
    newest: the last few keyframes themselves. gone: how many of them a track has gone along.
    """

    def __init__(self, session: str, kind: Kind, newest: int) -> None:
        self.newest: deque[Keyframe] = deque(maxlen=newest)
        self._session = session
        self._D, self._dof = TAG_DOF[kind] + 1, POSE_DOF[kind]
        self._n = self.gone = 0
        self._before: Moment | None = None
        self._resize(FIRST)

    def __len__(self) -> int:
        return self._n

    @property
    def seq(self) -> Index:
        return self._seq[: self._n]

    def add(self, keyframe: Keyframe, broken: bool) -> None:
        """`broken`: its odometry says nothing, as something before it is missing."""
        if self._n == len(self._seq):
            self._make_room()
        i, odom = self._n, None if broken else keyframe.odom
        self._seq[i], self._t_ns[i], self._whole[i] = keyframe.seq, keyframe.t_ns, odom is not None
        self._state[i] = _BY_ODOMETRY
        if odom is None:
            self._T_step[i], self._cov_step[i] = np.eye(self._D), 0.0
        else:
            self._T_step[i] = matrix(odom.T_prev_cur)
            self._cov_step[i] = unpack_upper(np.array(odom.cov), self._dof)
        self.newest.append(keyframe)
        self._n += 1

    def know(self, i: int, T_map_base: Array | None, cov: Array | None) -> None:
        """The pose at keyframe i of the trail; None: lost."""
        if T_map_base is None or cov is None:
            self._state[i] = _LOST
            return
        self._state[i] = _KNOWN
        self._T[i], self._cov[i] = T_map_base, cov

    def start_from(self, seq: int, before: Moment | None) -> None:
        """Forget everything up to `seq`; `before`: the pose there. All others are as odometry says,
        until more is known."""
        self._forget(int(np.searchsorted(self.seq, seq, side="right")))
        self._before, self.gone = before, 0
        self._state[: self._n] = _BY_ODOMETRY

    def forget(self) -> None:
        """All of it."""
        self._n, self.gone, self._before = 0, 0, None
        self.newest.clear()

    def steps(self, first: int, last: int) -> tuple[Array, Array, bool]:
        """T_step and cov_step of keyframes first to last - 1, and whether all of them are known."""
        among = slice(first, last)
        return self._T_step[among], self._cov_step[among], bool(self._whole[among].all())

    def moments(self) -> Iterator[Moment]:
        """All poses that are known, oldest first; covariances packed."""
        at = self._before
        if at is not None:
            yield at
        for i in range(self._n):
            at = self._moment(i, at)
            if at is not None:
                yield at

    def _moment(self, i: int, before: Moment | None) -> Moment | None:
        session, t_ns = self._session, int(self._t_ns[i])
        if self._state[i] == _KNOWN:
            return Moment(session, t_ns, self._T[i].copy(), pack_upper(self._cov[i]))
        if self._state[i] == _LOST or before is None or before.cov is None or not self._whole[i]:
            return None
        T, Ad = before.T_map_base[None].copy(), np.empty((self._dof, self._dof))
        cov = unpack_upper(before.cov[None], self._dof)
        carrying.adjoint_of_inverse(self._T_step[i], Ad)
        carrying.carry(self._T_step[i], Ad, self._cov_step[i], T, cov)
        return Moment(session, t_ns, T[0], pack_upper(cov[0]))

    def _make_room(self) -> None:
        if self._n < MOST:
            self._resize(2 * self._n)
            return
        at, gone = self._before, self._n // 4
        for i in range(gone):
            at = self._moment(i, at)
        self._forget(gone)
        self._before = at

    def _forget(self, count: int) -> None:
        kept = self._n - count
        for column in self._columns():
            column[:kept] = column[count : self._n]
        self._n, self.gone = kept, max(0, self.gone - count)

    def _columns(self) -> tuple[npt.NDArray[Any], ...]:
        columns = (self._seq, self._t_ns, self._whole, self._state)
        return (*columns, self._T_step, self._cov_step, self._T, self._cov)

    def _resize(self, size: int) -> None:
        old = self._columns() if self._n else ()
        D, dof = self._D, self._dof
        self._seq, self._t_ns = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
        self._whole, self._state = np.empty(size, dtype=bool), np.empty(size, dtype=np.int8)
        self._T_step, self._cov_step = np.empty((size, D, D)), np.empty((size, dof, dof))
        self._T, self._cov = np.empty((size, D, D)), np.empty((size, dof, dof))
        for before, after in zip(old, self._columns(), strict=bool(old)):
            after[: self._n] = before
