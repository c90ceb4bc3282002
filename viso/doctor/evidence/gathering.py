# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tries a stream on the autopilot in virtual time, and keeps all that the checks want to know."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from ekf_stub.ahrs.sources import SourceXY
from viso.doctor.evidence.boot_clock import by_boot_clock
from viso.doctor.evidence.compare import Comparison, compare, compare_paths
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.flow_fit import FlowFit, fit_flow, with_motion_of
from viso.doctor.evidence.set_up import SetUp, choose_set_up, vision_carried
from viso.doctor.evidence.stream_data import StreamData, stream_data
from viso.doctor.evidence.tracks import HandledMessage
from viso.doctor.evidence.trial import Trial, run_trial, without_trial
from viso.doctor.evidence.vehicle_data import VehicleData, is_of_simulator, listen
from viso.doctor.evidence.vehicle_position import SOURCE_SETS
from viso.firmware.releases import Firmware
from viso.parameters.left_out import left_out
from viso.streams.heard import firmware_of_recording
from viso.streams.stream_kinds import Aspect, Stream
from viso.vehicle.flow import STABILISED

_TURNING_RAD_S: Final = 0.05
_NOTHING_ELSE: Final = VehicleData()
_AXES_UNKNOWN: Final = (
    "nothing else tells how the vehicle moved, or too little: axes that fit each other, such as ENU at one height, "
    "are not judged"
)


def gather(
    stream: Stream,
    *,
    params: Mapping[str, float] = MappingProxyType({}),
    vehicle: VehicleData = _NOTHING_ELSE,
    firmware: Firmware | None = None,
    baud: int | None = None,
    heading_rad: float = 0.0,
    is_tried: bool = True,
    filter_s: float = math.inf,
    on_progress: Callable[[int], None] = lambda _count: None,
) -> Evidence:
    """Try a stream on a vehicle that moves as it says, and return what came of it.

    A stream without external navigation is not tried: all that there is comes from the vehicle in it.

    Args:
        stream: what is sent, and perhaps what the autopilot reported meanwhile.
        params: parameters that the user gives; they win over those of the stream.
        vehicle: what else describes the vehicle, such as its log; it wins over what is heard in the stream.
        firmware: the release to try it on; None for the one that is nearest to what flew.
        baud: rate of the link's transport-time model; None for a link without delay.
        heading_rad: where the vehicle points at first, if its attitude is not known.
        is_tried: whether it is tried at all; else every message counts as accepted, and no filter runs.
        filter_s: for how long the filter is run, from the first message of external navigation on.
        on_progress: gets the number of messages fed so far.

    Raises:
        InputError: a parameter has a value that it cannot take.
    """
    judged_by = firmware_of_recording(stream, firmware)
    release = judged_by.firmware
    heard = listen(stream, params, release)
    if heard.clock is not None:
        stream = by_boot_clock(stream, heard.clock)
        heard = replace(listen(stream, params, release), is_simulated=True)
    known = heard.overridden_by(vehicle)
    names = known.vision | vision_carried(stream)
    set_up = choose_set_up(stream, known, params, names, judged_by)
    if is_tried and names:
        messages, trial = run_trial(
            stream,
            set_up,
            heading_rad=heading_rad if known.attitude is None else float(known.attitude.euler_rad[0, 2]),
            heeds_stamps=known.are_stamps_steady,
            baud=baud,
            filter_s=filter_s,
            on_progress=on_progress,
        )
    else:
        messages, trial = without_trial(stream if names else replace(stream, messages=()), set_up)
    with np.errstate(all="ignore"):  # streams hold NaN and infinity
        evidence = _measured(stream, messages, known, set_up, trial)
    notes = [*stream.notes, *trial.notes, *evidence.notes]
    if trial.filter_until_us is not None:
        until = f"the first {filter_s:g} s of external navigation, to {trial.filter_until_us * 1e-6:.3f} s"
        notes.append(f"{stream.name}: the filter (a model) was run over {until} (--filter-seconds)")
    if evidence.stream.poses and not _knows_axes(evidence):
        notes.insert(0, f"{stream.name}: {_AXES_UNKNOWN}")
    notes += (f"{stream.name}: {note}" for note in judged_by.notes)
    notes += (f"{stream.name}: {line}" for line in left_out(set_up.known, of_estimator=True))
    return replace(evidence, notes=tuple(notes))


def _measured(
    stream: Stream, messages: tuple[HandledMessage, ...], vehicle: VehicleData, set_up: SetUp, trial: Trial
) -> Evidence:
    """Return evidence of a stream that was tried, with a note if the vehicle is left out of account."""
    sent = stream_data(stream, messages)
    comparisons = compare(sent.poses, sent.vision, vehicle.attitude, trial.params, vehicle.ground.turning)
    notes: tuple[str, ...] = ()
    if Aspect.RESETS in stream.lacks and _is_another_flight(comparisons):
        vehicle = replace(vehicle, attitude=None, height=None, position=None, level=None, truth=None)
        comparisons = ()
        notes = (f"{stream.name}: the vehicle turns otherwise, or at other times (--lead): left out of account",)
    is_simulated = vehicle.is_simulated or vehicle.truth is not None or is_of_simulator(stream.params)
    return Evidence(
        stream=sent,
        vehicle=replace(vehicle, is_simulated=is_simulated),
        set_up=set_up,
        trial=trial,
        comparisons=comparisons,
        paths=compare_paths(sent.poses, vehicle.position, comparisons, trial.params),
        flow_fits=_flow_fits(stream, sent, vehicle, trial),
        notes=notes,
    )


def _is_another_flight(comparisons: Sequence[Comparison]) -> bool:
    """Return whether the vehicle turns, and nowhere as the stream does: a trajectory has a clock of its own."""
    turning = [comparison for comparison in comparisons if comparison.since_arrival.rate_rad > _TURNING_RAD_S]
    return bool(turning) and not any(compared.since_arrival.enough_motion for compared in turning)


def _flow_fits(stream: Stream, sent: StreamData, vehicle: VehicleData, trial: Trial) -> tuple[FlowFit, ...]:
    """Return how flow fits the vehicle's motion, or else that of the stream's first poses."""
    ground, attitude = vehicle.ground, vehicle.attitude
    if ground.flows and not len(ground.turning) and sent.poses:
        ground, attitude = with_motion_of(ground, sent.poses[0])
    params = {**trial.params, **vehicle.params, **stream.params}
    uses_flow = any(params.get(f"EK3_SRC{number}_VELXY") == SourceXY.OPTFLOW for number in SOURCE_SETS)
    options = trial.params.get("FLOW_OPTIONS", 0.0)  # of the releases that have it
    is_stabilised = math.isfinite(options) and int(options) & STABILISED != 0
    return fit_flow(ground, attitude, vehicle.height, vehicle.position, uses_flow, is_stabilised)


def _knows_axes(evidence: Evidence) -> bool:
    """Return whether attitudes or a path show which way the stream's axes point."""
    if any(compared.orientation.sufficient or compared.carriers for compared in evidence.comparisons):
        return True
    return any(path.axes is not None and path.axes.sufficient for path in evidence.paths)
