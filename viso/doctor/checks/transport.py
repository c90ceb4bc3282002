# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN1: how messages come to the autopilot."""

from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np

from mav_handlers.handlers import VISION_NAMES
from mav_handlers.verdicts import BAD_CRC, NOT_ACCEPTED, NOT_ADDRESSED, OWN_MESSAGE, UNKNOWN_MESSAGE
from mav_handlers.wire.messages import COMMAND_INT, COMMAND_LONG, PARAM_SET, SET_GPS_GLOBAL_ORIGIN
from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, by_type, listed, share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import aiding_texts
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES, are_us
from viso.doctor.evidence.tracks import Bools, Ints, Track
from viso.streams.stream_kinds import Aspect

_MOST_ASKING: Final = 3
_ROUTING: Final = "MAVLink_routing.cpp, MAVLink_routing::check_and_forward"
_FOR_THE_AUTOPILOT: Final = (SET_GPS_GLOBAL_ORIGIN, COMMAND_LONG, COMMAND_INT, PARAM_SET)
_NOTE: Final = Severity.NOTE
_RECORD: Final = (
    "Nothing on the vehicle. What the messages hold cannot be judged from this recording: give the DataFlash log "
    "(.BIN) of the flight, or a recording of the link that the companion uses."
)
_GIVE_PARAMETERS: Final = (
    "If it is to use external navigation, give a recording with its parameters (or --defaults FILE.parm), of the link "
    "that the companion uses."
)
_RECORD_OR_SEND: Final = (
    "Record the link that the companion uses, or give the DataFlash log (.BIN) of the flight, which has what reached "
    "AP_VisualOdom. If nothing is sent, send ODOMETRY, or VISION_POSITION_ESTIMATE with VISION_SPEED_ESTIMATE."
)
_LOST_FIELDS: Final = {
    "VISION_POSITION_ESTIMATE": "covariance and reset_counter",
    "GLOBAL_VISION_POSITION_ESTIMATE": "covariance and reset_counter",
    "VICON_POSITION_ESTIMATE": "covariance",
    "ATT_POS_MOCAP": "covariance",
    "VISION_SPEED_ESTIMATE": "covariance and reset_counter",
}


def reach_signs(evidence: Evidence) -> list[str]:
    """Return what shows that external navigation reached the autopilot, in sentences; empty if nothing does."""
    own, sensor, found = evidence.vehicle.own_filter, evidence.vision_sensor, []
    if own is None:
        return []
    if sensor is not None and not evidence.is_sensor_shared:
        healthy = sensor.enabled & sensor.healthy
        if healthy.any():
            since = int(np.argmax(healthy))
            part = share(int(healthy.sum()), int(sensor.enabled[since:].sum()))
            first = at(sensor.time_us[since])
            found.append(f"SYS_STATUS calls the vision sensor healthy in {part} messages from {first} on")
    said = [(time_us, text) for time_us, by_extnav, text in aiding_texts(own.texts) if by_extnav]
    if said:
        found.append(f'the EKF said "{said[0][1]}" at {at(said[0][0])}')
    if (used_s := float(own.step_s[own.positioned_by_extnav].sum())) > 0:
        found.append(f"with positions from nothing else the EKF had one for {used_s:.0f} s ({own.record})")
    return found


@check(
    code="XN1-01",
    severity=Severity.ERROR,
    title="No external navigation in the stream",
    firmware=(
        "Without messages AP_VisualOdom has nothing to pass on. With VISO_TYPE set and the vision check of arming on, "
        "the vehicle then refuses to arm: VisOdom: not healthy."
    ),
    source="AP_VisualOdom.cpp, AP_VisualOdom::pre_arm_check",
    fix=(
        "Send ODOMETRY, or VISION_POSITION_ESTIMATE with VISION_SPEED_ESTIMATE; check that the recording was made on "
        "the link that the companion uses."
    ),
)
def no_vision(evidence: Evidence) -> Iterator[Sighting]:
    ground = evidence.vehicle.ground
    sent = bool(ground.unread or evidence.stream.gps_inputs) or any(
        (*(flow.units is not None for flow in ground.flows), *(finder.is_sent for finder in ground.ranges))
    )
    if evidence.stream.vision or evidence.is_off or (sent and not evidence.requests):
        return
    asked = f"{listed(evidence.requests, _MOST_ASKING)} ask for external navigation, and " if evidence.requests else ""
    if Aspect.LINK in evidence.stream.lacks:
        there = "no record of it is in the log"
    else:
        kinds = Counter(evidence.stream.kinds)
        names = listed([f"{name} ({count})" for name, count in kinds.most_common(5)], 5) or "nothing"
        there = f"of {kinds.total()} messages none is of external navigation; there are {names}"
    yield _sighting_without_vision(evidence, asked + there)


def _sighting_without_vision(evidence: Evidence, there: str) -> Sighting:
    """Return what it means that no message is recorded: that none came, or that it is not known whether any did."""
    signs, sensor = reach_signs(evidence), evidence.vision_sensor
    if signs:
        return Sighting(
            f"{there}; but it does reach the autopilot: {'; '.join(signs)}", (), fix=_RECORD, severity=_NOTE
        )
    if Aspect.LINK in evidence.stream.lacks:
        return Sighting(f"{there}: none came, or what came was dropped before the log")
    if evidence.vehicle.system_id is None:
        return Sighting(there)
    if not evidence.requests:
        text = f"{there}; nothing in the recording tells whether the vehicle is to use it: that is not judged"
        return Sighting(text, fix=_GIVE_PARAMETERS, severity=_NOTE)
    if sensor is not None and sensor.enabled.any() and not evidence.is_sensor_shared:
        return Sighting(f"{there}, and SYS_STATUS calls the vision sensor healthy in none of {len(sensor.time_us)}")
    text = f"{there}; nothing in the recording tells whether any reaches the autopilot on another link"
    return Sighting(text, fix=_RECORD_OR_SEND, severity=Severity.WARNING)


@check(
    code="XN1-02",
    severity=Severity.WARNING,
    title="MAVLink 1 loses fields",
    firmware=(
        "MAVLink 1 has no extension fields. They read 0: errors fall to the noise floors, and resets are not seen."
    ),
    source=(
        "mavlink_helpers.h, mavlink_frame_char_buffer; GCS_Common.cpp, "
        "GCS_MAVLINK::handle_common_vision_position_estimate_data"
    ),
    fix="Send MAVLink 2: pymavlink with MAVLINK20=1 in the environment, MAVROS with fcu_protocol v2.0.",
    needs={Aspect.LINK},
)
def mavlink_1(evidence: Evidence) -> Iterator[Sighting]:
    found = [message for message in evidence.stream.vision if message.version == 1 and message.name in _LOST_FIELDS]
    for name, of_name in by_type(found):
        total = sum(message.name == name for message in evidence.stream.vision)
        yield Sighting.in_messages(
            f"{share(len(of_name), total)} {name} came as MAVLink 1, without {_LOST_FIELDS[name]}", of_name
        )


def _skipped_numbers(evidence: Evidence, track: Track) -> Ints:
    """Return how many sequence numbers of the sender are missing before each message of a track."""
    sender = track.sender
    numbers, sequence = [], []
    for message in evidence.stream.messages:
        if message.sender == (sender.system_id, sender.component_id) and message.version:
            numbers.append(message.number)
            sequence.append(message.sequence)
    of_sender: Ints = np.array(sequence, dtype=np.int64)
    gap = (of_sender[1:] - of_sender[:-1] - 1) % 256
    total = np.concatenate([[0], np.cumsum(np.where(gap < 128, gap, 0))])
    return np.asarray(total[np.searchsorted(numbers, track.numbers)], dtype=np.int64)


def _is_missing_one(evidence: Evidence, track: Track) -> Bools:
    """Return after which messages sequence numbers and a message are missing; other types share the numbers."""
    times = track.stamp_us if are_us(track) else track.arrival_us
    interval = np.diff(times)
    usual = float(np.median(interval[interval > 0])) if bool(np.any(interval > 0)) else 0.0
    return np.asarray((np.diff(_skipped_numbers(evidence, track)) > 0) & (interval > 1.5 * usual), dtype=np.bool_)


@check(
    code="XN1-03",
    severity=Severity.WARNING,
    title="Messages were lost",
    firmware="Nothing requests lost messages again. After 300 ms without a message the sensor is unhealthy.",
    source="AP_VisualOdom_Backend.cpp, AP_VisualOdom_Backend::healthy",
    fix="Raise the baud rate or lower the message rate, use flow control, and look for buffers that overflow.",
    needs={Aspect.LINK},
)
def lost_messages(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.stream.tracks:
        if len(track) < FEWEST_MESSAGES:
            continue
        missing = np.flatnonzero(_is_missing_one(evidence, track))
        if len(missing):
            is_rare = len(missing) < limits.FEWEST_LOST or len(missing) < limits.LOST_SHARE * len(track)
            total = share(len(missing), len(track))
            yield Sighting(
                f"{track.sender}: behind {total} messages sequence numbers are missing, and so is a message",
                track.numbers[missing + 1].tolist(),
                int(track.arrival_us[missing[0]]),
                int(track.arrival_us[missing[-1] + 1]),
                severity=Severity.NOTE if is_rare else None,
            )


@check(
    code="XN1-04",
    severity=Severity.WARNING,
    title="Frames were damaged",
    firmware="The autopilot drops a frame with a wrong checksum, or of an unknown dialect, without a text.",
    source="mavlink_helpers.h, mavlink_frame_char_buffer",
    fix="Check baud rate, cable and ground.",
    needs={Aspect.LINK},
)
def damaged_frames(evidence: Evidence) -> Iterator[Sighting]:
    otherwise = [kind for kind in evidence.stream.refused if kind.is_defined_otherwise]
    for kind in otherwise:
        sender = f"{kind.system_id}/{kind.component_id}"
        yield Sighting(
            f"all {len(kind.refused)} {kind.name} from {sender} fail their checksum, while others pass: the sender has "
            "another definition of that message",
            kind.refused,
            severity=None if kind.name in VISION_NAMES else Severity.NOTE,
            fix=f"Generate the sender's messages from the same dialect as the autopilot's: the checksum covers the "
            f"definition of {kind.name}, of which the two have different versions.",
        )
    known = {number for kind in otherwise for number in kind.refused}
    refused = (BAD_CRC, UNKNOWN_MESSAGE)
    found = [
        message for message in evidence.stream.messages if message.verdict in refused and message.number not in known
    ]
    if found:
        frames = sum(message.version != 0 for message in evidence.stream.messages) + len(found)
        yield Sighting.in_messages(f"{share(len(found), frames)} frames were damaged", found)


@check(
    code="XN1-05",
    severity=Severity.WARNING,
    title="Several senders on one link",
    firmware=(
        "A link has one time corrector for all senders, and the backend treats all samples as one camera's. It mixes "
        "stamps, reset counters and positions."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::correct_offboard_timestamp_usec_to_ms",
    fix="Let one program send external navigation, and stop the others; or give each its own link and use only one.",
    needs={Aspect.LINK},
)
def several_senders(evidence: Evidence) -> Iterator[Sighting]:
    senders = Counter(message.sender for message in evidence.stream.vision)
    if len(senders) > 1:
        names = " and ".join(f"{system}/{component} ({count})" for (system, component), count in senders.items())
        (usual, _), *_ = senders.most_common(1)
        yield Sighting.in_messages(
            f"external navigation comes from {names}",
            [message for message in evidence.stream.vision if message.sender != usual],
        )


@check(
    code="XN1-06",
    severity=Severity.ERROR,
    title="Sent with the autopilot's own ids",
    firmware="Frames with the autopilot's own system and component id are dropped before any handler sees them.",
    source=_ROUTING,
    fix="Keep the system id, and set another component id, such as 197 (MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY).",
    needs={Aspect.LINK},
)
def own_ids(evidence: Evidence) -> Iterator[Sighting]:
    found = [message for message in evidence.stream.vision if message.verdict is OWN_MESSAGE]
    if found:
        ids = f"{found[0].system_id}/{found[0].component_id}"
        count = share(len(found), len(evidence.stream.vision))
        yield Sighting.in_messages(
            f"{count} messages of external navigation came as from {ids}, the autopilot itself", found
        )


@check(
    code="XN1-07",
    severity=Severity.WARNING,
    title="Addressed to another system",
    firmware="The autopilot may forward a message for another system. It does not use it.",
    source=_ROUTING,
    fix="Address the autopilot: its system id is MAV_SYSID, its component 1. 0 is everyone.",
    needs={Aspect.LINK},
)
def wrong_target(evidence: Evidence) -> Iterator[Sighting]:
    senders = {message.sender for message in evidence.stream.vision}
    found = [
        message
        for message in evidence.stream.messages
        if message.verdict is NOT_ADDRESSED
        and message.sender in senders
        and isinstance(message.message, _FOR_THE_AUTOPILOT)
    ]
    for name, of_name in by_type(found):
        target = getattr(of_name[0].message, "target_system", 0)
        text = f"addressed to system {target}; the autopilot is {evidence.system_id}"
        yield Sighting.in_messages(f"{len(of_name)} {name} {text}", of_name)


@check(
    code="XN1-08",
    severity=Severity.ERROR,
    title="Only the ground station is admitted",
    firmware="With bit 0 of MAV_OPTIONS set, frames from systems other than MAV_SYSID and MAV_GCS_SYSID are dropped.",
    source="GCS_Common.cpp, GCS_MAVLINK::accept_packet",
    fix="Send with the vehicle's own system id and another component id, or clear bit 0 of MAV_OPTIONS.",
    needs={Aspect.LINK},
)
def only_ground_station(evidence: Evidence) -> Iterator[Sighting]:
    found = [message for message in evidence.stream.vision if message.verdict is NOT_ACCEPTED]
    if found:
        own, gcs = evidence.system_id, evidence.ground_station_id
        text = f"{share(len(found), len(evidence.stream.vision))} messages refused: from system {found[0].system_id}"
        yield Sighting.in_messages(f"{text}, while only {own} and {gcs} are admitted", found)


@check(
    code="XN1-09",
    severity=Severity.WARNING,
    title="Messages came twice",
    firmware="The EKF drops the second one (20 ms rule); health and the log count it.",
    source="AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
    fix="Look for two routes from sender to autopilot, such as two endpoints of mavlink-router.",
    needs={Aspect.LINK},
)
def repeated_messages(evidence: Evidence) -> Iterator[Sighting]:
    latest: dict[tuple[int, int, str], bytes] = {}
    found = []
    for message in evidence.stream.vision:
        key = (*message.sender, message.name)
        if latest.get(key) == message.frame:
            found.append(message)
        latest[key] = message.frame
    if len(found) >= limits.FEWEST_LOST:
        yield Sighting.in_messages(
            f"{share(len(found), len(evidence.stream.vision))} messages came twice, byte for byte", found
        )


@check(
    code="XN1-10",
    severity=Severity.WARNING,
    title="Messages came out of order",
    firmware=(
        "The autopilot does not sort samples. One older than the last passes the 20 ms rule, because its age is an "
        "unsigned difference, and is fused after the newer one."
    ),
    source="AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
    fix="Send over a serial port or TCP, or over one network path only.",
    needs={Aspect.LINK},
)
def reordered_messages(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.stream.tracks:
        if len(track) < FEWEST_MESSAGES or not are_us(track):
            continue
        step = np.diff(track.sequence) % 256
        back = np.flatnonzero((step >= 192) & (np.diff(track.stamp_us) < 0))
        if len(back):
            first = at(track.arrival_us[back[0] + 1])
            text = f"messages came behind one that was sent later, the first at {first}"
            yield Sighting.in_track(f"{track.sender}: {share(len(back), len(track))} {text}", track, back + 1)
