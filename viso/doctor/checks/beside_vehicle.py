# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stream's paths and headings compared with the vehicle's, as other sources than the stream show them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.evidence.compare import ALIGNING_TYPES, comparison_of, oriented
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import POSITION, Witness
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.tracks import Bools, Floats, Ints, Poses, Sender, Track, Velocities
from viso.doctor.evidence.vehicle_data import AttitudeSeries
from viso.doctor.evidence.vehicle_position import PositionSeries
from viso.estimators.heading import heading_departure
from viso.estimators.likeness import Likeness, estimate_likeness
from viso.geometry.rotation import quats_from_euler
from viso.streams.stream_kinds import Aspect

ALIGNED: Final = "VisOdom: yaw shifted"
"""What types 2 and 3 say when they turn the camera's frame to north."""

_FAILED: Final = -1


@dataclass(frozen=True, slots=True, eq=False)
class SentPath:
    """The path of a stream: its positions, or the sum of its velocities.

    Attributes:
        track: the messages.
        chosen: N, the indices of those that are compared.
        pos_m: N x 3, the path.
        breaks_us: when the path begins again, us since boot.
    """

    track: Track
    chosen: Ints
    pos_m: Floats
    breaks_us: Ints

    @property
    def arrival_us(self) -> Ints:
        """N, when the chosen messages arrived, us since boot."""
        return np.asarray(self.track.arrival_us[self.chosen], dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class HeadingDeparture:
    """A stream's heading against the vehicle's.

    Attributes:
        poses: of the stream.
        source: of the vehicle's heading, such as ATT.
        chosen: N, the indices of the messages that are compared.
        off_rad: N, the difference of the headings, less the constant difference.
        since_begin_rad: N, the difference of the headings, less that at the begin.
        turning_rad: N, the vehicle's rate of turn in rad/s.
    """

    poses: Poses
    source: str
    chosen: Ints
    off_rad: Floats
    since_begin_rad: Floats
    turning_rad: Floats


def is_of_one_time(evidence: Evidence) -> bool:
    """Return whether the times of stream and vehicle are comparable: a trajectory has a clock of its own."""
    if Aspect.RESETS not in evidence.stream.lacks:
        return True
    return any(compared.since_arrival.enough_motion for compared in evidence.comparisons)


def aligned_us(evidence: Evidence) -> list[int]:
    """Return when poses were aligned, by the emulated autopilot or by the one whose log holds them."""
    own = evidence.vehicle.own_filter if evidence.vehicle_witness is Witness.LOG else None
    texts = [(time_us, text) for time_us, _, text in evidence.trial.texts] + ([] if own is None else [*own.texts])
    return [time_us for time_us, text in texts if text.startswith(ALIGNED)]


def follows_vehicle(evidence: Evidence, time_us: Ints) -> Bools:
    """Return when the autopilot moved logged positions along with a vehicle that navigated by another source."""
    own = evidence.vehicle.own_filter if evidence.vehicle_witness is Witness.LOG else None
    if own is None or evidence.viso_type not in ALIGNING_TYPES:
        return np.zeros(len(time_us), dtype=np.bool_)
    return own.is_fed_by_others(POSITION, time_us)


def frame_moved_us(evidence: Evidence, poses: Poses) -> Ints:
    """Return when a stream's frame may have moved on purpose: at a change of the reset counter, or at an alignment."""
    aligned = aligned_us(evidence) if evidence.viso_type in ALIGNING_TYPES else []
    changed = poses.track.arrival_us[1:][np.diff(poses.reset_counter) != 0]
    return np.sort(np.concatenate([changed, np.array(aligned, dtype=np.int64)]))


def paths_of_poses(evidence: Evidence) -> Iterator[tuple[Poses, SentPath]]:
    """Yield poses and their path, without failed ones and without those that follow the vehicle."""
    for poses in evidence.stream.poses:
        fine = (np.abs(poses.pos_m) < limits.FARTHEST_M).all(axis=1) & (poses.quality != _FAILED)
        chosen = np.flatnonzero(fine & ~follows_vehicle(evidence, poses.track.arrival_us))
        if len(chosen) >= limits.FEWEST_COMPARED:
            yield poses, SentPath(poses.track, chosen, poses.pos_m[chosen], frame_moved_us(evidence, poses))


def paths_of_velocities(evidence: Evidence) -> Iterator[tuple[Velocities, SentPath]]:
    """Yield velocities and the path that they sum up to; gaps are left out."""
    for velocities in evidence.stream.velocities:
        chosen = np.flatnonzero((np.abs(velocities.used) < limits.NONSENSE_M_S).all(axis=1))
        if len(chosen) < limits.FEWEST_COMPARED:
            continue
        used, time_us = velocities.used[chosen], velocities.track.arrival_us[chosen]
        step_s = np.diff(time_us) * 1e-6
        gap = step_s > limits.SUMMED_GAP_S
        moved = 0.5 * (used[1:] + used[:-1]) * np.where(gap, 0.0, step_s)[:, None]
        pos_m = np.concatenate([np.zeros((1, 3)), np.cumsum(moved, axis=0)])
        yield velocities, SentPath(velocities.track, chosen, pos_m, time_us[1:][gap])


def reference_of(position: PositionSeries) -> tuple[Ints, Floats]:
    """Return times and positions; without height if it is not known, or is a GPS's, which wanders."""
    has_height = np.isfinite(position.ned_m[:, 2]).all() and not position.origin.startswith("GPS")
    return position.time_us, position.ned_m if has_height else position.ned_m[:, :2]


def heading_departures(evidence: Evidence) -> Iterator[HeadingDeparture]:
    """Yield how the heading of each stream of poses departs from the vehicle's."""
    vehicle = evidence.vehicle.best_attitude
    if vehicle is None or len(vehicle) < FEWEST_MESSAGES or not is_of_one_time(evidence):
        return
    for poses in evidence.poses_with_attitude:
        quats = oriented(poses.quat_wxyz, evidence.viso_type, int(evidence.param("VISO_ORIENT")))
        compared = comparison_of(poses, evidence.comparisons)
        delay_us = 0 if compared is None else int(compared.late_ms * 1e3)
        there = vehicle.at(poses.track.arrival_us - delay_us)
        norm = np.linalg.norm(quats, axis=1)
        fine = np.isfinite(there).all(axis=1) & (np.abs(norm - 1) < 0.1) & (poses.quality != _FAILED)
        fine &= ~evidence.vehicle.is_attitude_wrong(poses.track.arrival_us)
        chosen = np.flatnonzero(fine)
        if len(chosen) < limits.FEWEST_COMPARED:
            continue
        time_us = poses.track.arrival_us[chosen]
        edges = np.concatenate([frame_moved_us(evidence, poses), _yaw_set_us(vehicle)])
        parts = np.searchsorted(np.sort(edges), time_us, side="right")
        off_rad, since_begin_rad = np.zeros((2, len(chosen)))
        for part in np.unique(parts).tolist():
            inside = parts == part
            if np.ptp(time_us[inside]) >= limits.SHORTEST_COMPARED_US and np.count_nonzero(inside) >= FEWEST_MESSAGES:
                of_vehicle = quats_from_euler(there[chosen][inside])
                off_rad[inside] = heading_departure(quats[chosen][inside], of_vehicle)
                begin_rad = np.median(off_rad[inside][:FEWEST_MESSAGES])
                since_begin_rad[inside] = np.angle(np.exp(1j * (off_rad[inside] - begin_rad)))
        source = f"{vehicle.origin}, which may follow the stream" if vehicle.follows_stream else vehicle.origin
        turning_rad = _turning_rad(vehicle, time_us - delay_us)
        yield HeadingDeparture(poses, source, chosen, off_rad, since_begin_rad, turning_rad)


def _yaw_set_us(vehicle: AttitudeSeries) -> Ints:
    """Return when the vehicle's own yaw was set, as by an alignment in flight: no vehicle turns so fast."""
    yaw = vehicle.euler_rad[:, 2]
    step = np.abs(np.angle(np.exp(1j * np.diff(yaw))))
    usual = np.abs(np.angle(np.exp(1j * (yaw[2:] - yaw[:-2]))))
    around = np.maximum(np.append(usual, 0.0) - step, np.append(0.0, usual) - step)
    is_step = (
        (step > limits.YAW_SET_RAD) & (np.diff(vehicle.time_us) < limits.YAW_SET_WITHIN_US) & (around < 0.5 * step)
    )
    return np.asarray(vehicle.time_us[1:][is_step], dtype=np.int64)


def _turning_rad(vehicle: AttitudeSeries, time_us: Ints) -> Floats:
    """Return the vehicle's rate of turn about the vertical around some times, in rad/s."""
    ends = [
        vehicle.at(np.clip(time_us + by, vehicle.time_us[0], vehicle.time_us[-1]))
        for by in (-limits.TURNING_AROUND_US, limits.TURNING_AROUND_US)
    ]
    return np.asarray(np.abs(ends[1][:, 2] - ends[0][:, 2]) / (2e-6 * limits.TURNING_AROUND_US), dtype=np.float64)


def _departs(heading: HeadingDeparture, off_rad: Floats) -> Bools:
    """Return which messages have a yaw that is wrong for a while, by more than lateness in a turn explains."""
    allowed = limits.HEADING_OFF_RAD + limits.HEADING_LATE_S * heading.turning_rad
    off = np.asarray(np.abs(off_rad) > allowed, dtype=np.bool_)
    return lasting(heading.poses.track.arrival_us[heading.chosen], off)


def departure_mask(heading: HeadingDeparture) -> Bools:
    """Return which messages have a yaw that is wrong by more than lateness in a turn explains; none if they are few."""
    mask = _departs(heading, heading.off_rad)
    return mask if np.mean(mask) > limits.HEADING_OFF_SHARE else np.zeros_like(mask)


def departs_from_us(heading: HeadingDeparture) -> int:
    """Return when the heading first left the vehicle's, by their difference at the begin."""
    mask = _departs(heading, heading.since_begin_rad)
    first = int(np.argmax(mask if mask.any() else departure_mask(heading)))
    return int(heading.poses.track.arrival_us[heading.chosen[first]])


def heading_departs(evidence: Evidence, sender: Sender) -> bool:
    """Return whether the sender's yaw departs from the vehicle's: then nothing that it rotates shows axes."""
    return any(
        departure.poses.track.sender == sender and departure_mask(departure).any()
        for departure in heading_departures(evidence)
    )


def likeness_of(evidence: Evidence, path: SentPath) -> Likeness | None:
    """Return how a path resembles the vehicle's; None if that is not known, or the vehicle moved too little."""
    position = evidence.vehicle.position
    if position is None or not is_of_one_time(evidence):
        return None
    found = estimate_likeness(
        path.arrival_us, path.pos_m, *reference_of(position), noise_m=position.noise_m, breaks_us=path.breaks_us
    )
    return found if found.sufficient else None


def is_related(evidence: Evidence, poses: Poses) -> bool:
    """Return whether positions move with the vehicle, so that their axes and scale can be judged."""
    for comparison, path in paths_of_poses(evidence):
        found = likeness_of(evidence, path) if comparison is poses else None
        if found is not None:
            return found.correlation >= limits.RELATED_CORRELATION and found.unlike < limits.UNLIKE_SHARE
    return True


def lasting(time_us: Ints, mask: Bools) -> Bools:
    """Return a mask without the runs that last no longer than ``limits.LASTING_US``."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8))) + 1
    kept = mask.copy()
    for run in np.split(np.arange(len(mask)), edges):
        if len(run) and time_us[run[-1]] - time_us[run[0]] <= limits.LASTING_US:
            kept[run] = False
    return kept
