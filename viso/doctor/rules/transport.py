# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN1: how messages come to the autopilot."""

from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np

from mav_handlers.verdicts import BAD_CRC, NOT_ACCEPTED, NOT_ADDRESSED, OWN_MESSAGE, UNKNOWN_MESSAGE
from mav_handlers.wire.messages import COMMAND_INT, COMMAND_LONG, PARAM_SET, SET_GPS_GLOBAL_ORIGIN
from viso.doctor.evidence import Evidence
from viso.doctor.findings import Severity, Sighting, error, warning
from viso.doctor.measures.sender_clock import FEWEST, are_us
from viso.doctor.measures.tracks import Bools, Ints, Track
from viso.doctor.outputs.phrases import at, by_type, listed, of_some, seen_in, share
from viso.doctor.trial_parameters import VISION_NAMES
from viso.streams.stream_kinds import Aspect

_LEAST_LOST: Final = 3
_LOST_SHARE: Final = 0.02
_MOST_ASKING: Final = 3
_ROUTING: Final = "MAVLink_routing.cpp, MAVLink_routing::check_and_forward"
_FOR_THE_AUTOPILOT: Final = (SET_GPS_GLOBAL_ORIGIN, COMMAND_LONG, COMMAND_INT, PARAM_SET)
_LOST_FIELDS: Final = {
    "VISION_POSITION_ESTIMATE": "covariance and reset_counter",
    "GLOBAL_VISION_POSITION_ESTIMATE": "covariance and reset_counter",
    "VICON_POSITION_ESTIMATE": "covariance",
    "ATT_POS_MOCAP": "covariance",
    "VISION_SPEED_ESTIMATE": "covariance and reset_counter",
}


@error(
    "XN1-01",
    "No external navigation in the stream",
    "Nothing reaches AP_VisualOdom; with VISO_TYPE set the vehicle refuses to arm: VisOdom: not healthy.",
    "AP_VisualOdom.cpp, AP_VisualOdom::pre_arm_check",
    "Send ODOMETRY, or VISION_POSITION_ESTIMATE with VISION_SPEED_ESTIMATE; check that the recording was made on the "
    "link that the companion uses.",
)
def _no_vision(evidence: Evidence) -> Iterator[Sighting]:
    sent = any(one.units is not None for one in evidence.ground.flows) or any(
        one.is_sent for one in evidence.ground.ranges
    )
    if evidence.vision or evidence.is_off or (sent and not evidence.asks):
        return
    asked = f"{listed(evidence.asks, _MOST_ASKING)} ask for external navigation, and " if evidence.asks else ""
    if Aspect.LINK in evidence.lacks:
        yield Sighting(f"{asked}no record of it is there: none came, or what came was dropped before the log")
        return
    there = listed([f"{name} ({count})" for name, count in Counter(evidence.kinds).most_common(5)], 5) or "nothing"
    total = sum(evidence.kinds.values())
    yield Sighting(f"{asked}of {total} messages none is of external navigation; there are {there}")


@warning(
    "XN1-02",
    "MAVLink 1 loses fields",
    "MAVLink 1 has no extension fields. They read 0: errors fall to the noise floors, and resets are not seen.",
    "mavlink_helpers.h, mavlink_frame_char_buffer; GCS_Common.cpp, "
    "GCS_MAVLINK::handle_common_vision_position_estimate_data",
    "Send MAVLink 2: pymavlink with MAVLINK20=1 in the environment, MAVROS with fcu_protocol v2.0.",
    needs=frozenset({Aspect.LINK}),
)
def _version_1(evidence: Evidence) -> Iterator[Sighting]:
    found = [one for one in evidence.vision if one.version == 1 and one.name in _LOST_FIELDS]
    for name, of_name in by_type(found):
        total = sum(one.name == name for one in evidence.vision)
        yield seen_in(f"{share(len(of_name), total)} {name} came as MAVLink 1, without {_LOST_FIELDS[name]}", of_name)


def _skipped(evidence: Evidence, track: Track) -> Ints:
    """Return how many sequence numbers of a track's sender are missing up to each of its messages."""
    sender = track.sender
    numbers, sequence = [], []
    for one in evidence.messages:
        if one.sender == (sender.system_id, sender.component_id) and one.version:
            numbers.append(one.number)
            sequence.append(one.sequence)
    of_sender: Ints = np.array(sequence, dtype=np.int64)
    gap = (of_sender[1:] - of_sender[:-1] - 1) % 256
    total = np.concatenate([[0], np.cumsum(np.where(gap < 128, gap, 0))])
    return np.asarray(total[np.searchsorted(numbers, track.numbers)], dtype=np.int64)


def _is_missing_one(evidence: Evidence, track: Track) -> Bools:
    """Tell behind which messages sequence numbers are missing and a message is, too: others share the numbers."""
    times = track.stamp_us if are_us(track) else track.arrival_us
    interval = np.diff(times)
    usual = float(np.median(interval[interval > 0])) if bool(np.any(interval > 0)) else 0.0
    return np.asarray((np.diff(_skipped(evidence, track)) > 0) & (interval > 1.5 * usual), dtype=np.bool_)


@warning(
    "XN1-03",
    "Messages were lost",
    "Nothing requests lost messages again. After 300 ms without a message the sensor is unhealthy.",
    "AP_VisualOdom_Backend.cpp, AP_VisualOdom_Backend::healthy",
    "Raise the baud rate or lower the message rate, use flow control, and look for buffers that overflow.",
    needs=frozenset({Aspect.LINK}),
)
def _lost(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.tracks:
        if len(track) < FEWEST:
            continue
        missing = np.flatnonzero(_is_missing_one(evidence, track))
        if len(missing):
            is_rare = len(missing) < _LEAST_LOST or len(missing) < _LOST_SHARE * len(track)
            total = share(len(missing), len(track))
            yield Sighting(
                f"{track.sender}: behind {total} messages sequence numbers are missing, and so is a message",
                track.numbers[missing + 1].tolist(),
                int(track.arrival_us[missing[0]]),
                int(track.arrival_us[missing[-1] + 1]),
                severity=Severity.NOTE if is_rare else None,
            )


@warning(
    "XN1-04",
    "Frames were damaged",
    "The autopilot drops a frame with a wrong checksum, or of an unknown dialect, without a text.",
    "mavlink_helpers.h, mavlink_frame_char_buffer",
    "Check baud rate, cable and ground.",
    needs=frozenset({Aspect.LINK}),
)
def _damaged(evidence: Evidence) -> Iterator[Sighting]:
    otherwise = [kind for kind in evidence.refused if kind.is_defined_otherwise]
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
    found = [one for one in evidence.messages if one.verdict in refused and one.number not in known]
    if found:
        frames = sum(one.version != 0 for one in evidence.messages) + len(found)
        yield seen_in(f"{share(len(found), frames)} frames were damaged", found)


@warning(
    "XN1-05",
    "Several senders on one link",
    "A link has one time corrector for all senders, and the backend treats all samples as one camera's. It mixes "
    "stamps, reset counters and positions.",
    "GCS_Common.cpp, GCS_MAVLINK::correct_offboard_timestamp_usec_to_ms",
    "Let one program send external navigation, and stop the others; or give each its own link and use only one.",
    needs=frozenset({Aspect.LINK}),
)
def _many_senders(evidence: Evidence) -> Iterator[Sighting]:
    senders = Counter(one.sender for one in evidence.vision)
    if len(senders) > 1:
        names = " and ".join(f"{system}/{component} ({count})" for (system, component), count in senders.items())
        (usual, _), *_ = senders.most_common(1)
        yield seen_in(
            f"external navigation comes from {names}", [one for one in evidence.vision if one.sender != usual]
        )


@error(
    "XN1-06",
    "Sent with the autopilot's own ids",
    "Frames with the autopilot's own system and component id are dropped before any handler sees them.",
    _ROUTING,
    "Keep the system id, and set another component id, such as 197 (MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY).",
    needs=frozenset({Aspect.LINK}),
)
def _own_ids(evidence: Evidence) -> Iterator[Sighting]:
    found = [one for one in evidence.vision if one.verdict is OWN_MESSAGE]
    if found:
        ids = f"{found[0].system_id}/{found[0].component_id}"
        count = share(len(found), len(evidence.vision))
        yield seen_in(f"{count} messages of external navigation came as from {ids}, the autopilot itself", found)


@warning(
    "XN1-07",
    "Addressed to another system",
    "The autopilot may forward a message for another system. It does not use it.",
    _ROUTING,
    "Address the autopilot: its system id is MAV_SYSID, its component 1. 0 is everyone.",
    needs=frozenset({Aspect.LINK}),
)
def _wrong_target(evidence: Evidence) -> Iterator[Sighting]:
    senders = {one.sender for one in evidence.vision}
    found = [
        one
        for one in evidence.messages
        if one.verdict is NOT_ADDRESSED and one.sender in senders and isinstance(one.message, _FOR_THE_AUTOPILOT)
    ]
    for name, of_name in by_type(found):
        target = getattr(of_name[0].message, "target_system", 0)
        told = f"addressed to system {target}; the autopilot is {evidence.system_id}"
        yield seen_in(f"{len(of_name)} {name} {told}", of_name)


@error(
    "XN1-08",
    "Only the ground station is admitted",
    "With bit 0 of MAV_OPTIONS set, frames from systems other than MAV_SYSID and MAV_GCS_SYSID are dropped.",
    "GCS_Common.cpp, GCS_MAVLINK::accept_packet",
    "Send with the vehicle's own system id and another component id, or clear bit 0 of MAV_OPTIONS.",
    needs=frozenset({Aspect.LINK}),
)
def _only_gcs(evidence: Evidence) -> Iterator[Sighting]:
    found = [one for one in evidence.vision if one.verdict is NOT_ACCEPTED]
    if found:
        own, gcs = evidence.system_id, evidence.ground_station_id
        text = f"{share(len(found), len(evidence.vision))} messages refused: from system {found[0].system_id}"
        yield seen_in(f"{text}, while only {own} and {gcs} are admitted", found)


@warning(
    "XN1-09",
    "Messages came twice",
    "The EKF drops the second one (20 ms rule); health and the log count it.",
    "AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
    "Look for two routes from sender to autopilot, such as two endpoints of mavlink-router.",
    needs=frozenset({Aspect.LINK}),
)
def _repeated(evidence: Evidence) -> Iterator[Sighting]:
    latest: dict[tuple[int, int, str], bytes] = {}
    found = []
    for one in evidence.vision:
        key = (*one.sender, one.name)
        if latest.get(key) == one.frame:
            found.append(one)
        latest[key] = one.frame
    if len(found) >= _LEAST_LOST:
        yield seen_in(f"{share(len(found), len(evidence.vision))} messages came twice, byte for byte", found)


@warning(
    "XN1-10",
    "Messages came out of order",
    "The autopilot does not sort samples. One older than the last passes the 20 ms rule, because its age is an "
    "unsigned difference, and is fused after the newer one.",
    "AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
    "Send over a serial port or TCP, or over one network path only.",
    needs=frozenset({Aspect.LINK}),
)
def _reordered(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.tracks:
        if len(track) < FEWEST or not are_us(track):
            continue
        step = np.diff(track.sequence) % 256
        back = np.flatnonzero((step >= 192) & (np.diff(track.stamp_us) < 0))
        if len(back):
            first = at(track.arrival_us[back[0] + 1])
            text = f"messages came behind one that was sent later, the first at {first}"
            yield of_some(f"{track.sender}: {share(len(back), len(track))} {text}", track, back + 1)
