# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""AP_VisualOdom over whole columns of samples: the same bits as one call a sample, at a small part of the cost.

The scalar port is the definition and does what is not plain: a pose whose reset counter is new, one at which the
camera is aligned, one with an error that is NaN. What lies between two of these is a straight stretch, where each
sample is computed by itself, and arrays take the same operations in the same order.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import numpy as np

from ap_core.clock import VirtualClock
from ap_core.dataflash_dtype import Column
from ap_core.fmath import RAD_TO_DEG
from ap_core.fmath_arrays import (
    array_of,
    constrain_array,
    euler_arrays,
    quaternion_of_arrays,
    vector_of_arrays,
)
from ap_core.internal_error import InternalErrorSink
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamGroup
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import AP_VisualOdom
from ap_visualodom.ap_visualodom_backend import ANG_ERR_MAX_RAD, AP_VISUALODOM_TIMEOUT_MS, POS_ERR_MAX_M
from ap_visualodom.batch_backends import StraightBackend, straight_backend
from ap_visualodom.batch_samples import (
    CONSUMED_NUMBER,
    VERDICT_NUMBER,
    PoseResults,
    Poses,
    Velocities,
    VelocityResults,
)
from ap_visualodom.ports import Ahrs, RecordSink, TextSink
from ap_visualodom.release import REFERENCE, VisualOdomRelease
from ap_visualodom.verdicts import QUALITY_BELOW_MIN, RESET_SETTLING

CHUNK_ROWS: Final = 8192
"""What is computed at once fits a processor's caches."""
SHORT_ROWS: Final = 16
"""Fewer samples are done faster one by one."""

Event = tuple[int, Callable[[], object]]
"""Something that happens before the sample of a place: a parameter set, an alignment asked for, another AHRS."""


_JUDGED: Final = np.uint8(CONSUMED_NUMBER), np.uint8(VERDICT_NUMBER[QUALITY_BELOW_MIN])
_SETTLING: Final = np.uint8(VERDICT_NUMBER[RESET_SETTLING])


class _Tap:
    """Stands between the library and its vehicle, and keeps what it says of the sample that is being taken."""

    def __init__(self, ahrs: Ahrs, logger: RecordSink) -> None:
        self.initialised = ahrs.initialised
        self.dcm_yaw_initialised = ahrs.dcm_yaw_initialised
        self.using_extnav_for_yaw = ahrs.using_extnav_for_yaw
        self.get_yaw_rad = ahrs.get_yaw_rad
        self.get_quaternion = ahrs.get_quaternion
        self.get_relative_position_NED_origin_float = ahrs.get_relative_position_NED_origin_float
        self.writeBodyFrameOdom = ahrs.writeBodyFrameOdom
        self._ahrs, self._logger = ahrs, logger
        self.is_open = False
        self.record: Sequence[Any] = ()
        self.reset_ms = 0

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        self.record = values
        if not self.is_open:
            self._logger.write(structure, values)

    def writeExtNavData(
        self,
        pos: Vector3f,
        quat: Quaternion,
        posErr: np.float32,
        angErr: np.float32,
        timeStamp_ms: int,
        delay_ms: int,
        resetTime_ms: int,
    ) -> None:
        self.reset_ms = resetTime_ms
        if not self.is_open:
            self._ahrs.writeExtNavData(pos, quat, posErr, angErr, timeStamp_ms, delay_ms, resetTime_ms)

    def writeExtNavVelData(self, vel: Vector3f, err: np.float32, timeStamp_ms: int, delay_ms: int) -> None:
        if not self.is_open:
            self._ahrs.writeExtNavVelData(vel, err, timeStamp_ms, delay_ms)


class BatchVisualOdom:
    """AP_VisualOdom that takes samples in columns.

    Args:
        params: the VISO_ parameters.
        ahrs: reference for alignment. It is not given the samples in columns: what its answers depend on is the clock
            and what events do.
        gcs: where texts go.
        logger: where records go that are of no sample in a column, as of VISION_POSITION_DELTA.
        clock: is set to the time of what is being done.
        errors: where internal errors go.
        release: which release to be.

    Attributes:
        visual_odom: the library itself, for all else: ``init`` it, ask for alignments, look at its health.
    """

    def __init__(
        self,
        params: ParamGroup,
        *,
        ahrs: Ahrs,
        gcs: TextSink,
        logger: RecordSink,
        clock: VirtualClock,
        errors: InternalErrorSink,
        release: VisualOdomRelease = REFERENCE,
    ) -> None:
        self._clock = clock
        self._tap = _Tap(ahrs, logger)
        self.visual_odom = AP_VisualOdom(
            params, ahrs=self._tap, gcs=gcs, logger=self._tap, clock=clock, errors=errors, release=release
        )

    def handle(
        self, poses: Poses, velocities: Velocities, events: Iterable[Event] = ()
    ) -> tuple[PoseResults, VelocityResults]:
        """Take samples in their common sequence, and return what became of each.

        Args:
            poses: see :class:`Poses`.
            velocities: see :class:`Velocities`.
            events: in the order of their places; the clock still has the time of the sample before.

        Raises:
            ValueError: if the places of both tables together are not 0, 1, 2 and so on.
        """
        _check_places(poses.place, velocities.place)
        run = _Run(self, poses, velocities)
        begin = 0
        for place, happens in events:
            run.go(begin, place)
            begin = place
            happens()
        run.go(begin, len(poses) + len(velocities))
        return run.pose_results, run.velocity_results


class _Run:
    """One call of BatchVisualOdom.handle."""

    def __init__(self, batch: BatchVisualOdom, poses: Poses, velocities: Velocities) -> None:
        self._clock, self._tap, self._frontend = batch._clock, batch._tap, batch.visual_odom
        self._poses, self._velocities = poses, velocities
        self.pose_results = PoseResults.empty(len(poses))
        self.velocity_results = VelocityResults.empty(len(velocities))
        self._bad = np.isnan(poses.pos_err) | np.isnan(poses.ang_err)

    def go(self, begin: int, end: int) -> None:
        """Take the samples from one place up to another."""
        backend = straight_backend(self._frontend)
        if backend is None:
            self._refuse(begin, end)
            return
        pose, last = np.searchsorted(self._poses.place, (begin, end)).tolist()
        turns = pose + np.flatnonzero(self._bad[pose:last] | backend.turns(self._poses.rows(pose, last)))
        while begin < end:
            pose = int(np.searchsorted(self._poses.place, begin))
            cut = self._next_cut(backend, turns, pose, last)
            place = end if cut == last else int(self._poses.place[cut])
            if begin < place:
                self._straight(backend, begin, place)
            if place < end:
                self._one_pose(backend, cut)
            begin = place + 1

    def _next_cut(self, backend: StraightBackend, turns: Column, pose: int, last: int) -> int:
        """Return the number of the first pose that the scalar port has to take, ``last`` if there is none."""
        if pose == last:
            return last
        if backend.is_turn(int(self._poses.reset_counter[pose])):
            return pose
        next_turn = int(np.searchsorted(turns, pose))
        cut = int(turns[next_turn]) if next_turn < len(turns) else last
        return pose + backend.first_aligned(self._poses.time_us[pose:cut], self._clock)

    def _rows(self, begin: int, end: int) -> tuple[slice, slice]:
        pose_rows, velocity_rows = (
            slice(*np.searchsorted(table.place, (begin, end)).tolist()) for table in (self._poses, self._velocities)
        )
        return pose_rows, velocity_rows

    def _refuse(self, begin: int, end: int) -> None:
        number = VERDICT_NUMBER[self._frontend._refusal()]
        pose_rows, velocity_rows = self._rows(begin, end)
        self.pose_results.verdict[pose_rows] = number
        self.velocity_results.verdict[velocity_rows] = number
        if end > begin:
            self._clock.set_us(self._time_us(end - 1))

    def _time_us(self, place: int) -> int:
        poses, velocities = self._poses, self._velocities
        row = int(np.searchsorted(poses.place, place))
        if row < len(poses) and poses.place[row] == place:
            return int(poses.time_us[row])
        return int(velocities.time_us[np.searchsorted(velocities.place, place)])

    # Sample by sample

    def _one_pose(self, backend: StraightBackend, row: int) -> None:
        poses, results = self._poses, self.pose_results
        time_us, given = int(poses.time_us[row]), Quaternion(*poses.quat[:, row])
        self._clock.set_us(time_us)
        results.was_healthy[row] = backend.driver.healthy()
        self._tap.is_open, self._tap.reset_ms = True, 0
        verdict = self._frontend.handle_pose_estimate(
            int(poses.remote_us[row]),
            int(poses.time_ms[row]),
            Vector3f(*poses.pos[:, row]),
            given,
            poses.pos_err[row],
            poses.ang_err[row],
            int(poses.reset_counter[row]),
            int(poses.quality[row]),
        )
        self._tap.is_open = False
        record = self._tap.record
        results.verdict[row] = VERDICT_NUMBER[verdict]
        results.pos[:, row], results.euler_deg[:, row] = record[3:6], record[6:9]
        results.quat[:, row] = backend.attitude_made_of(given).to_wxyz()
        results.pos_err[row], results.ang_err[row] = record[9:11]
        results.delay_ms[row], results.reset_ms[row] = self._frontend.get_delay_ms(), self._tap.reset_ms

    def _one_velocity(self, backend: StraightBackend, row: int) -> None:
        velocities, results = self._velocities, self.velocity_results
        self._clock.set_us(int(velocities.time_us[row]))
        results.was_healthy[row] = backend.driver.healthy()
        self._tap.is_open = True
        verdict = self._frontend.handle_vision_speed_estimate(
            int(velocities.remote_us[row]),
            int(velocities.time_ms[row]),
            Vector3f(*velocities.vel[:, row]),
            int(velocities.reset_counter[row]),
            int(velocities.quality[row]),
        )
        self._tap.is_open = False
        record = self._tap.record
        results.verdict[row] = VERDICT_NUMBER[verdict]
        results.vel[:, row], results.err[row] = record[3:6], record[6]
        results.delay_ms[row] = self._frontend.get_delay_ms()

    def _one_by_one(self, backend: StraightBackend, poses: slice, velocities: slice) -> None:
        rows = [(self._poses.place[row], self._one_pose, row) for row in range(poses.start, poses.stop)]
        for row in range(velocities.start, velocities.stop):
            rows.append((self._velocities.place[row], self._one_velocity, row))
        for _, take, row in sorted(rows, key=lambda one: int(one[0])):
            take(backend, row)

    # Stretch by stretch

    def _straight(self, backend: StraightBackend, begin: int, end: int) -> None:
        if end - begin < SHORT_ROWS:
            self._one_by_one(backend, *self._rows(begin, end))
            return
        for place in range(begin, end, CHUNK_ROWS):
            self._chunk(backend, place, min(place + CHUNK_ROWS, end))

    def _chunk(self, backend: StraightBackend, begin: int, end: int) -> None:
        pose_rows, velocity_rows = self._rows(begin, end)
        poses = self._poses.rows(pose_rows.start, pose_rows.stop)
        velocities = self._velocities.rows(velocity_rows.start, velocity_rows.stop)
        made = self.pose_results.rows(pose_rows.start, pose_rows.stop)
        made_velocities = self.velocity_results.rows(velocity_rows.start, velocity_rows.stop)
        with np.errstate(all="ignore"):
            healthy, settled, now_ms = self._in_sequence(backend, poses, velocities, begin, end)
            of_poses, of_velocities = poses.place - begin, velocities.place - begin
            made.was_healthy[:], made_velocities.was_healthy[:] = healthy[of_poses], healthy[of_velocities]
            if len(poses):
                self._make_poses(backend, poses, made, settled[of_poses], now_ms[of_poses])
            if len(velocities):
                self._make_velocities(backend, velocities, made_velocities, settled[of_velocities])
        self._clock.set_us(self._time_us(end - 1))

    def _in_sequence(
        self, backend: StraightBackend, poses: Poses, velocities: Velocities, begin: int, end: int
    ) -> tuple[Column, Column, Column]:
        """Return whether it still was healthy, whether no reset is just seen, and the time in ms, of each sample."""
        driver = backend.driver
        now_ms, quality = np.empty(end - begin, np.uint32), np.empty(end - begin, np.int8)
        for table in (poses, velocities):
            now_ms[table.place - begin] = table.time_us // np.uint64(1000)
            quality[table.place - begin] = table.quality
        since_ms = np.diff(now_ms, prepend=np.uint32(driver._last_update_ms))
        settled = np.arange(end - begin) >= backend.settled_from(now_ms)
        driver._last_update_ms, driver._quality = int(now_ms[-1]), int(quality[-1])
        return since_ms < AP_VISUALODOM_TIMEOUT_MS, settled, now_ms

    def _verdicts(self, quality: Column, settled: Column) -> Column:
        good = quality >= self._frontend.get_quality_min()
        return np.where(settled, np.where(good, *_JUDGED), _SETTLING)

    def _make_poses(
        self, backend: StraightBackend, poses: Poses, made: PoseResults, settled: Column, now_ms: Column
    ) -> None:
        frontend, count = self._frontend, len(poses)
        attitude = backend.attitude(quaternion_of_arrays(poses.quat))
        roll, pitch, yaw = euler_arrays(attitude)
        made.pos[:] = array_of(backend.position(vector_of_arrays(poses.pos)), count)
        made.quat[:] = array_of(attitude, count)
        made.euler_deg[:] = roll * RAD_TO_DEG, pitch * RAD_TO_DEG, backend.yaw_deg(yaw)
        made.pos_err[:] = constrain_array(poses.pos_err, frontend.get_pos_noise(), POS_ERR_MAX_M)
        made.ang_err[:] = constrain_array(poses.ang_err, frontend.get_yaw_noise(), ANG_ERR_MAX_RAD)
        made.verdict[:] = self._verdicts(poses.quality, settled)
        made.delay_ms[:] = frontend.get_delay_ms()
        _note_resets(backend, poses.reset_counter, made, now_ms)
        backend.note_last_pose(Vector3f(*made.pos[:, -1]), Quaternion(*made.quat[:, -1]), int(poses.reset_counter[-1]))

    def _make_velocities(
        self, backend: StraightBackend, velocities: Velocities, made: VelocityResults, settled: Column
    ) -> None:
        made.vel[:] = array_of(backend.velocity(vector_of_arrays(velocities.vel)), len(velocities))
        made.err[:] = self._frontend.get_vel_noise()
        made.verdict[:] = self._verdicts(velocities.quality, settled)
        made.delay_ms[:] = self._frontend.get_delay_ms()


def _note_resets(backend: StraightBackend, counter: Column, made: PoseResults, now_ms: Column) -> None:
    """Fill in when the last reset was, of consumed poses (AP_VisualOdom_Backend::get_reset_timestamp_ms)."""
    rows = np.flatnonzero(made.verdict == CONSUMED_NUMBER)
    if not len(rows):
        return
    driver, told = backend.driver, counter[rows].astype(np.int64)
    is_new = np.diff(told, prepend=driver._last_reset_counter) != 0
    newest = np.maximum.accumulate(np.where(is_new, np.arange(len(rows)), -1))
    reset_ms = np.where(newest < 0, np.uint32(driver._reset_timestamp_ms), now_ms[rows][newest])
    made.reset_ms[rows] = reset_ms
    driver._last_reset_counter, driver._reset_timestamp_ms = int(told[-1]), int(reset_ms[-1])


def _check_places(*columns: Column) -> None:
    places = np.concatenate(columns)
    ascend = all((np.diff(column) > 0).all() for column in columns)
    seen = np.bincount(places, minlength=len(places)) if len(places) and places.min() >= 0 else places
    if not ascend or len(seen) != len(places) or not (seen == 1).all():
        raise ValueError("the places of poses and velocities are not 0, 1, 2 and so on, in ascending order")
