# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The index of the autopilot's texts: for each its usual cause, what to look at, and what to change.

The pages `docs/texts.md` and `docs/arming.md` are written from it.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

_BEFORE: Final = re.compile(r"^(?:pre-?arm: |arm: |ekf[23] imu\d+ )+", re.IGNORECASE)
_NUMBER: Final = re.compile(r"-?\\?-?(?:0x[0-9a-f]+|\d+(?:\\?\.\d+)?)", re.IGNORECASE)
_FILLED_IN: Final = re.compile(r"\{(.*?)\}")


@dataclass(frozen=True, slots=True)
class Text:
    """A text of the autopilot.

    Attributes:
        sample: as it is sent, with numbers as an example; what else is filled in stands in braces.
        cause: the usual one, or what the text means.
        check: what to look at.
        fix: what to change.
        codes: findings of the doctor that look into it.
    """

    sample: str
    cause: str
    check: str
    fix: str
    codes: tuple[str, ...] = ()

    @property
    def shown(self) -> str:
        """The sample without its braces."""
        return _FILLED_IN.sub(r"\1", self.sample)

    def fits(self, text: str) -> bool:
        """Return whether a text is this one, with any numbers; what it begins with before arming may be missing."""
        pieces = _FILLED_IN.split(without_beginning(self.sample))
        fixed = [_NUMBER.sub(r"[-+0-9a-fx.]+", re.escape(piece)) for piece in pieces[::2]]
        return re.fullmatch(".*".join(fixed), without_beginning(text), re.IGNORECASE) is not None


def without_beginning(text: str) -> str:
    """Return a text without what names the core, or says that it is before arming."""
    return _BEFORE.sub("", " ".join(text.split()))


IN_FLIGHT: Final = (
    Text(
        "EKF variance",
        "two of the filter's test ratios stayed too large for a second: external navigation, or another source, "
        "contradicts what the vehicle feels; or its position was lost",
        "`EKF_STATUS_REPORT`, or XKF4 in the log (SV, SP, SH, SM, and TS for lost ones): which ratio rose first, and "
        "whether messages came until then",
        "axes, scale, delay and yaw of the stream; fly on in STABILIZE or ALT_HOLD, which need no position",
        ("XN9-13", "XN9-10", "XN9-11", "XN3-11"),
    ),
    Text(
        "EKF variance: over thresholds",
        "as `EKF variance`, from 2026-04 on: two test ratios are above FS_EKF_THRESH",
        "XKF4, or `EKF_STATUS_REPORT`: the two ratios",
        "axes, scale, delay and yaw of the stream; fly on in STABILIZE or ALT_HOLD",
        ("XN9-13", "XN9-10", "XN9-11"),
    ),
    Text(
        "EKF variance: position lost",
        "the filter has no position any more: messages stopped for 7 s, or all were rejected for as long",
        "whether messages of external navigation came until then; XKF4.TS",
        "keep the stream alive, also with poor tracking; fly on in STABILIZE or ALT_HOLD",
        ("XN9-16", "XN4-05", "XN9-13"),
    ),
    Text(
        "EKF Failsafe: changed to {LAND} Mode",
        "the EKF check failed for a second in a mode that needs a position: the vehicle does as FS_EKF_ACTION says",
        "the text `EKF variance` before it, and its cause; whether the stream stopped",
        "remove the cause of `EKF variance`; FS_EKF_ACTION chooses LAND, ALT_HOLD, or LAND in any mode",
        ("XN9-13", "XN9-16"),
    ),
    Text(
        "EKF Failsafe",
        "as above, and the mode stays: it needs no position, or FS_EKF_ACTION reports only",
        "the text `EKF variance` before it",
        "remove the cause of `EKF variance`; do not change to a mode that needs a position",
        ("XN9-13",),
    ),
    Text(
        "EKF Failsafe Cleared",
        "the EKF check passes again",
        "what had failed before: the filter may have reset its position meanwhile",
        "the mode does not come back by itself: choose one",
        ("XN9-13",),
    ),
    Text(
        "EKF3 IMU0 stopped aiding",
        "the filter has neither position nor velocity: the stream stopped, or all samples were rejected, for 15 s; "
        "it holds the last position",
        "gaps of the stream, and the test ratios before (XKF4)",
        "keep the stream alive; on the ground it starts again by itself once samples come",
        ("XN9-16", "XN9-03", "XN4-05"),
    ),
    Text(
        "EKF3 IMU0 is using external nav data",
        "the filter navigates by your messages from now on; the text comes once for each core",
        "that it comes before take-off, and does not come again in flight: that would be a restart",
        "nothing; without it see `docs/why.md`, or `viso doctor` on a recording",
        ("XN9-01", "XN9-15"),
    ),
    Text(
        "EKF3 IMU0 is using GPS",
        "the filter navigates by GPS from now on",
        "EK3_SRC1_POSXY and VELXY of the active set",
        "if external navigation is meant, set EK3_SRC1_POSXY to 6, or switch to the set that has it",
        ("XN7-05", "XN9-15"),
    ),
    Text(
        "EKF3 IMU0 started relative aiding",
        "the filter has a velocity without a position: by optical flow, wheels, or VISION_POSITION_DELTA",
        "whether poses come, and EK3_SRC1_POSXY",
        "for a position send poses, and set EK3_SRC1_POSXY to 6",
        ("XN7-03",),
    ),
    Text(
        "EKF3 IMU0 fusing odometry",
        "VISION_POSITION_DELTA, or wheels, give the velocity",
        "that the deltas are not zero while the vehicle moves (XKFD in the log)",
        "nothing",
        ("XN9-32",),
    ),
    Text(
        "EKF3 IMU0 fusing optical flow",
        "optical flow gives the velocity",
        "the range finder: flow needs the height above ground",
        "nothing",
        ("XNF-12",),
    ),
    Text(
        "EKF3 IMU0 emergency yaw reset",
        "the EKF check failed, and the filter took its yaw from an estimate by GPS (EKFGSF)",
        "the compass, or the yaw of the stream, against the course; EK3_SRC1_YAW",
        "calibrate the compass, or correct the yaw that is sent; EK3_SRC1_YAW 6 only if the stream knows north",
        ("XN9-31", "XN8-04", "XN9-11"),
    ),
    Text(
        "EKF3 IMU0 forced reset",
        "the filter's covariance went bad, and it restarts in flight",
        "numbers that are not finite, sudden motion, vibration; the log around it",
        "remove NaN and jumps from the stream",
        ("XN5-01", "XN5-02", "XN9-16"),
    ),
    Text(
        "EKF3 IMU0 tilt alignment complete",
        "roll and pitch are known: normal, some seconds after boot",
        "nothing; if it does not come, the vehicle moves",
        "hold still after boot",
    ),
    Text("EKF3 IMU0 initialised", "the filter starts: normal after boot", "nothing", "nothing; in flight it restarted"),
    Text(
        "EKF3 IMU0 yaw aligned",
        "the filter took its yaw from external navigation (EK3_SRC1_YAW 6), or it needs none",
        "whether this yaw is that of the vehicle: 0 is north, and clockwise counts",
        "nothing; if the stream does not know north, the map is turned as it is",
        ("XN8-04",),
    ),
    Text("EKF3 IMU0 yaw aligned to GPS velocity", "yaw was taken from the course over ground", "the course", "nothing"),
    Text("EKF3 IMU0 yaw aligned using GPS", "yaw was taken from the EKFGSF estimate", "the compass", "nothing"),
    Text(
        "EKF3 IMU0 switching to compass 1",
        "the compass that was used failed or disagreed for long",
        "XKF4.SM, and the field of each compass (MAG)",
        "indoors do without: EK3_SRC1_YAW 6 and COMPASS_USE 0",
        ("XN9-11",),
    ),
    Text("EKF3 IMU0 MAG0 initial yaw alignment complete", "yaw by compass is known", "the heading", "nothing"),
    Text(
        "EKF3 IMU0 MAG0 in-flight yaw alignment complete",
        "yaw was aligned again after take-off, by compass",
        "the heading before and after (XKF1.Yaw): external navigation in another frame jumps with it",
        "indoors do without a compass",
        ("XN9-31",),
    ),
    Text(
        "EKF3 IMU0 MAG0 ground mag anomaly, yaw re-aligned",
        "the field at the ground was another one than above it",
        "iron in the ground at the place of take-off",
        "take off elsewhere, or do without a compass",
        ("XN9-31",),
    ),
    Text(
        "EKF3 IMU0 origin set",
        "the filter has an origin: positions can be shown on a map, and the EKF check can act from now on",
        "the height at this moment: it is 0 only if external navigation begins at z = 0",
        "set the origin before the first pose arrives, or where z is 0",
        ("XN7-31",),
    ),
    Text(
        "EKF3: origin already set",
        "SET_GPS_GLOBAL_ORIGIN, or a GPS, came after an origin was set; it cannot be moved",
        "who set it first: a GPS does even if no source is GPS",
        "GPS1_TYPE 0 where the origin is to be your own, or set it before the first fix; restart to set another one",
        ("XN7-32",),
    ),
    Text(
        "EKF3 IMU0 initial pos NED = 0.0,0.0,-0.1 (m)",
        "where the estimate begins",
        "that the third number is near 0 on the ground",
        "let z begin at 0",
        ("XN9-31",),
    ),
    Text(
        "EKF3 IMU0 initial vel NED = 0.0,0.0,0.0 (m/s)", "how fast the estimate begins", "that it is near 0", "nothing"
    ),
    Text(
        "EKF3 lane switch 1",
        "the filter goes over to another core, whose test ratios are smaller",
        "XKF4 of all cores (C, PI): vibration or a bad IMU if they differ, the stream if all are alike",
        "if all reject alike, see `EKF variance`",
        ("XN9-14",),
    ),
    Text(
        "EKF primary changed:1",
        "as `EKF3 lane switch`: the vehicle follows another core",
        "XKF4.PI",
        "as `EKF3 lane switch`",
        ("XN9-14",),
    ),
    Text(
        "Using EKF Source Set 2",
        "the source set was switched, by an auxiliary function",
        "position and yaw just before and after (XKF1): two sources with different origins jump by their difference",
        "EK3_SRC_OPTIONS 2 aligns external navigation while optical flow is in use; VISO_TYPE 2 and 3 align by "
        "themselves",
        (
            "XN9-31",
            "XN8-07",
        ),
    ),
    Text(
        "RC7: VisOdomAlign HIGH",
        "a switch of the radio was moved whose RCn_OPTION is 80: high aligns the camera, other positions do nothing",
        "the text `VisOdom: yaw shifted` that follows with VISO_TYPE 2 or 3",
        "nothing",
    ),
    Text(
        "VisOdom: yaw shifted 0 to 90 deg",
        "the camera's frame was turned to the vehicle's yaw (VISO_TYPE 2 or 3)",
        "that the vehicle's yaw was right at this moment",
        "nothing; in flight, or by a wrong compass, it turns a good map",
        ("XN8-01",),
    ),
    Text(
        "VisOdom: reset",
        "the reset counter of a T265 changed: it is ignored for a second, and aligned again",
        "how often it happens",
        "light, texture and vibration of the camera",
        ("XN6-04",),
    ),
    Text(
        "Internal Errors 0x400",
        "a state that the firmware considers impossible: bit 0x400 is a bad rotation",
        "NaN in poses or covariances",
        "leave such a message out; a restart clears it",
        ("XN5-01", "XN5-02", "XN5-10"),
    ),
    Text(
        "AHRS: DCM active",
        "the vehicle's attitude is of the simple estimator: normal until EKF3 is ready",
        "that `AHRS: EKF3 active` follows; in flight EKF3 has failed",
        "see `EKF3 IMU0 forced reset`",
        ("XN7-12",),
    ),
    Text("AHRS: EKF3 active", "the vehicle uses EKF3", "nothing", "nothing"),
    Text(
        "AHRS: using recorded origin:{-35.3632621,149.1652374,584.0}",
        "the origin of an earlier start was taken (AHRS_ORIGIN_LAT and others)",
        "that the vehicle is still there",
        "set another origin before, or clear the parameters",
    ),
    Text(
        "Field Elevation Set: 584m",
        "the height of the origin is the height of the field from now on",
        "that the altitude of the origin is right",
        "set the origin with its altitude above the sea",
        ("XN7-31",),
    ),
    Text(
        "Mode change to {LOITER} failed: requires position",
        "the mode needs a position, and the filter has none",
        "`EKF3 IMU0 is using external nav data` must have come, and `stopped aiding` not",
        "stay in ALT_HOLD or STABILIZE; let the filter fuse external navigation",
        ("XN9-15", "XN9-16"),
    ),
    Text(
        "Mode change to {ALT_HOLD} failed: need alt estimate",
        "the mode needs a height, and the filter has none",
        "the source EK3_SRC1_POSZ, and XKF4.SH",
        "use the barometer: EK3_SRC1_POSZ 1",
    ),
    Text(
        "Mode change to {AUTO} failed: init failed",
        "the mode has a condition of its own, such as a mission or a home",
        "the mode's text before it",
        "another mode",
    ),
)
"""Of flight and of the filter: the words of most reports."""

OF_THE_FIRMWARE: Final = (
    Text(
        "Gyros inconsistent",
        "two gyros differ by more than 5 deg/s: one is badly calibrated, or shakes",
        "that nothing moves the vehicle; IMU[].Gyr in the log",
        "hold still, and calibrate the gyros or restart",
    ),
    Text("Accels inconsistent", "two accelerometers differ", "IMU[].Acc; the mounting", "calibrate them"),
    Text(
        "Compasses inconsistent",
        "two compasses point in different directions",
        "metal and currents near them",
        "calibrate, or switch the bad one off; COMPASS_USE 0 with EK3_SRC1_YAW 6",
    ),
    Text(
        "GPS Glitch or Compass error",
        "the filter rejects the GPS, or the compass",
        "XKF4.SP and SM",
        "indoors set GPS1_TYPE 0, and COMPASS_USE 0 with EK3_SRC1_YAW 6",
        ("XN9-11",),
    ),
    Text("Glitch cleared", "the GPS agrees again", "the position before and after", "nothing"),
    Text(
        "EKF2 IMU0 has stopped aiding",
        "firmware before 4.1, or EK2: the stream stopped or was rejected",
        "gaps of the stream",
        "keep it alive",
        ("XN9-16", "XN7-12"),
    ),
    Text(
        "EKF3 not enough memory",
        "this board has no memory for so many cores",
        "EK3_IMU_MASK",
        "EK3_IMU_MASK 1, or a larger board",
    ),
    Text(
        "Vibration compensation ON",
        "the height contradicts the accelerometers: vibration, or a height source that lies",
        "VIBE in the log; XKF4.SH; the height of the stream",
        "damp the mounting; EK3_SRC1_POSZ 1",
        ("XN8-13",),
    ),
    Text("Vibration compensation OFF", "the height fits again", "as before", "nothing"),
    Text(
        "EKF3 IMU0 yaw external",
        "the yaw of a GPS with two antennas (EK3_SRC1_YAW 3) is back after a time on the compass: "
        "external navigation has nothing to do with it",
        "EK3_SRC1_YAW",
        "nothing; for the yaw of a camera set EK3_SRC1_YAW 6",
        ("XN7-08",),
    ),
    Text(
        "EKF3 IMU0 yaw fallback active",
        "the yaw of a GPS stopped in flight for 10 s, and EK3_SRC1_YAW is 3: the compass gives it",
        "the second antenna and the sky",
        "nothing; for the yaw of a camera set EK3_SRC1_YAW 6",
    ),
    Text(
        "EKF3 waiting for GPS config data",
        "a source of the active set is GPS, and the filter does not start before the receiver's type is known; the "
        "text comes every 10 s",
        "the sources EK3_SRC1_; whether a receiver is connected, and `GPS1_TYPE`",
        "without a GPS take sources other than 3 (and 8 for the yaw), and GPS1_TYPE 0; with one, its type and port",
        ("XN7-04", "XN7-05"),
    ),
    Text(
        "EKF3 IMU0 is using range beacons",
        "the filter navigates by beacons (UWB) from now on",
        "EK3_SRC1_POSXY of the active set: 4 is beacons",
        "if external navigation is meant, set EK3_SRC1_POSXY to 6",
        ("XN7-05",),
    ),
    Text("EKF3 IMU0 initial pos NE = 0.0,0.0 (m)", "where the estimate by beacons begins", "nothing", "nothing"),
    Text(
        "EKF3 allocation failed",
        "there is no memory for the filter's cores: EK3_ENABLE is 0 from now on",
        "EK3_IMU_MASK; what else needs memory (scripting, log buffers)",
        "EK3_IMU_MASK 1, or a larger board",
        ("XN7-12",),
    ),
    Text(
        "AHRS: no EKF3 cores", "EK3_IMU_MASK names no IMU that is there", "EK3_IMU_MASK", "EK3_IMU_MASK 3, and restart"
    ),
    Text(
        "AHRS: invalid EKF type",
        "AHRS_EKF_TYPE chooses an estimator that this build lacks",
        "AHRS_EKF_TYPE",
        "set it to 3, and restart",
        ("XN7-12",),
    ),
    Text(
        "AHRS: EKF2 not started", "AHRS_EKF_TYPE is 2", "AHRS_EKF_TYPE", "set it and EK3_ENABLE to 3 and 1", ("XN7-12",)
    ),
    Text(
        "AHRS: Not healthy",
        "the estimator in use is not healthy, and gives no closer reason",
        "XKF4, or `EKF_STATUS_REPORT`",
        "as for `AHRS: EKF3 core 0 unhealthy`",
        ("XN9-10",),
    ),
    Text(
        "Altitude disparity",
        "with a position, the filter's height and the barometer's are more than 1 m apart on the ground: with "
        "EK3_SRC1_POSZ 6, a stream whose z does not begin at 0, or a barometer that has drifted",
        "z of the stream (VISP.PZ) against CTUN.BAlt",
        "let z begin at 0; calibrate the barometer while disarmed",
        ("XN7-31", "XN8-13"),
    ),
    Text(
        "Dead Reckoning started",
        "the filter has a position, and nothing measures position or velocity any more: only inertial data carry it",
        "whether messages of external navigation still come",
        "fly on in STABILIZE or ALT_HOLD; keep the stream alive",
        ("XN4-05", "XN9-16"),
    ),
    Text(
        "Dead Reckoning timeout",
        "it has lasted for FS_DR_TIMEOUT, after which a position by inertial data alone counts no more",
        "as `Dead Reckoning started`",
        "as `Dead Reckoning started`",
        ("XN4-05",),
    ),
    Text("Dead Reckoning stopped", "the filter has measurements again", "the position before and after", "nothing"),
    Text(
        "Fence requires position",
        "a fence is on (FENCE_ENABLE, FENCE_TYPE), and there is no position in the world",
        "whether an origin was set, and `is using external nav data` came",
        "set the origin; or indoors FENCE_ENABLE 0",
        ("XN9-15", "XN9-18"),
    ),
    Text(
        "Fence enabled, need position estimate",
        "likewise, of an attempt to arm in a mode that needs no position itself",
        "likewise",
        "likewise",
        ("XN9-15",),
    ),
    Text(
        "Need 3D Fix",
        "firmware up to 3.6: the mode needs a position, and the filter has none; later the text is "
        "`Need Position Estimate`, or one of `AHRS`",
        "that the filter uses external navigation",
        "firmware of today; before 4.1 external navigation goes to EKF2",
        ("XN9-15",),
    ),
    Text(
        "Bad GPS Position",
        "firmware up to 3.6: a receiver is set, and has no 3D fix",
        "GPS_TYPE",
        "indoors set GPS_TYPE 0",
    ),
    Text(
        "GPS Glitch",
        "firmware up to 3.6: the filter rejects the GPS; today `GPS Glitch or Compass error`",
        "the innovations of position",
        "indoors set GPS_TYPE 0",
        ("XN9-11",),
    ),
    Text("GPS {1}: was not found", "no receiver answers", "GPS1_TYPE and its port", "indoors set GPS1_TYPE 0"),
    Text(
        "GPS 1: primary but TYPE 0",
        "GPS_PRIMARY names a receiver that is off",
        "GPS_PRIMARY",
        "GPS_PRIMARY 0, or its type",
    ),
    Text(
        "GPS positions differ by 80.0m", "two receivers are 50 m or more apart", "both fixes", "switch the bad one off"
    ),
    Text(
        "Compass not calibrated",
        "a compass that is used has no calibration",
        "COMPASS_USE and COMPASS_OFS_X",
        "calibrate it; or do without: COMPASS_USE 0 (and 2, 3) with EK3_SRC1_YAW 6",
        ("XN7-08",),
    ),
    Text(
        "Compass not healthy",
        "a compass that is used delivers nothing",
        "its cable",
        "mend it; or COMPASS_USE 0 with EK3_SRC1_YAW 6",
    ),
    Text("Compass calibrated requires reboot", "the calibration counts from the next start", "nothing", "restart"),
    Text("Compass offsets too high", "iron or magnets near it", "what is mounted near it", "move it, calibrate again"),
    Text(
        "Check mag field:  900, max 875, min 185",
        "the field's strength is none of the earth: indoors steel and currents, or no calibration",
        "the place",
        "move away, calibrate; or COMPASS_USE 0 with EK3_SRC1_YAW 6",
    ),
    Text(
        "Check mag field ({xy} diff:150>100)",
        "the field differs from that of the earth at the origin: indoors, or at an invented origin",
        "whether the origin is where the vehicle is",
        "set the origin to the true place; or COMPASS_USE 0 with EK3_SRC1_YAW 6; ARMING_MAGTHRESH is the limit",
    ),
    Text("Gyros not healthy", "a gyro delivers nothing", "the board", "restart; else another board"),
    Text("Gyros not calibrated", "it moved at start", "nothing", "hold still, and restart"),
    Text("Accels not healthy", "an accelerometer delivers nothing", "the board", "restart; else another board"),
    Text("3D Accel calibration needed", "accelerometers were never calibrated", "nothing", "calibrate them"),
    Text(
        "Crash: Disarming: AngErr=45>30, Accel=0.5<3.0",
        "for 2 s its attitude was far from the wanted one, without acceleration: it lay on the ground",
        "what came before: `EKF variance`, a wrong yaw, a jump",
        "the cause before it",
        ("XN9-31", "XN9-10"),
    ),
    Text(
        "GCS Failsafe{ - Disarming}",
        "the ground station's heartbeats stopped; those of a companion do not count unless it has that id",
        "MAV_GCS_SYSID, before 4.7 SYSID_MYGCS",
        "FS_GCS_ENABLE chooses what happens, 0 nothing",
    ),
)
"""What the firmware says and viso does not."""

EXTERNAL_NAVIGATION: Final = (
    Text(
        "VisOdom: not healthy",
        "the autopilot took no external-navigation message in the last 300 ms, or since boot; one that it ignores "
        "counts, one that it drops does not",
        "whether messages arrive at all, and whether they are dropped: `viso serve` and the page say why for each",
        "send at 4 Hz or more, in messages that it accepts; or leave the check out: bit 18 of the checks, after which "
        "a vehicle arms without a working camera",
        ("XN1-01", "XN2-01", "XN4-03", "XN7-01"),
    ),
    Text(
        "VisOdom: out of memory",
        "`VISO_TYPE` was set at run time, or is not a known type",
        "`VISO_TYPE`",
        "restart the autopilot; 1 is MAVLink, 2 a T265, 3 VOXL",
        ("XN7-02",),
    ),
    Text(
        "VisOdom: check VISO_ORIENT parameter",
        "the T265's backend does not support this `VISO_ORIENT`",
        "`VISO_ORIENT`",
        "0 forward, 2 right, 4 back, 6 left, 24 up, 25 down",
    ),
    Text(
        "VisOdom: waiting for AHRS attitude",
        "the vehicle's own attitude is not known yet",
        "the texts of the AHRS",
        "wait for the filter; if it does not start, see `AHRS` below",
    ),
    Text(
        "VisOdom: roll/pitch diff 12.0 deg (>10)",
        "roll or pitch of the camera and of the vehicle differ by more than 10 degrees",
        "`viso doctor` on a recording: it compares both attitudes",
        "send body axes forward, right, down; check the mounting and `VISO_ORIENT`",
        ("XN8-05", "XN2-06"),
    ),
    Text(
        "VisOdom: yaw diff 30.0 deg (>10)",
        "the headings of the camera and of the vehicle differ by more than 10 degrees",
        "whether the camera knows north",
        "align the yaw (auxiliary function 80, the page's `y`), or use the camera's yaw: `EK3_SRC1_YAW` 6",
        ("XN8-01", "XN8-04"),
    ),
)
ESTIMATOR: Final = (
    Text(
        "ExternalAHRS: Invalid backend",
        "`AHRS_EKF_TYPE` is 11, an external estimator, and none is there",
        "`AHRS_EKF_TYPE`",
        "set `AHRS_EKF_TYPE` to 3 and restart",
        ("XN7-12",),
    ),
    Text(
        "AHRS: EKF3 not started",
        "the filter does not run yet",
        "`AHRS_EKF_TYPE` and `EK3_ENABLE`",
        "wait 5 s after boot; if it stays, `AHRS_EKF_TYPE` must be 3 and `EK3_ENABLE` 1",
        ("XN7-12",),
    ),
    Text(
        "AHRS: not using configured AHRS type",
        "the same, of a vehicle with a compass; or AHRS_EKF_TYPE chooses an estimator that does not run",
        "the same",
        "the same",
        ("XN7-12",),
    ),
    Text(
        "AHRS: EKF3 still initialising",
        "it runs, but is not aligned yet, or no position source reaches it",
        "what the filter does with the samples: `viso doctor`",
        "wait; if the text stays, no source named by `EK3_SRC1_` delivers",
        ("XN9-15", "XN7-08"),
    ),
    Text(
        "AHRS: EKF3 core 0 unhealthy",
        "its test ratios are too large, or its sources have stopped",
        "the innovations (XKF3)",
        "the data contradict the motion, or arrive late (`VISO_DELAY_MS`)",
        ("XN9-10", "XN9-11"),
    ),
    Text(
        "AHRS: EKF3 Roll/Pitch inconsistent 12 deg. Wait or reboot",
        "two cores disagree about the attitude",
        "both IMUs",
        "wait; check the errors that `--imu-error` gives to IMUs",
    ),
    Text(
        "AHRS: EKF3 Yaw inconsistent 30 deg. Wait or reboot",
        "two cores disagree about the yaw",
        "both IMUs; compass",
        "wait; or take the yaw from external navigation",
    ),
    Text(
        "AHRS: Check {EK3_SRC1_POSXY}",
        "the value of that parameter is not valid for it",
        "the parameter, in all sets",
        "external navigation is 6; the page of parameters has all values",
        ("XN7-07",),
    ),
    Text(
        "AHRS: EK3 sources require {VisualOdom}",
        "a source set names a sensor that the vehicle does not have",
        "all three sets",
        "for external navigation set `VISO_TYPE` and restart; else take the sensor out of all three sets",
        ("XN7-01",),
    ),
    Text(
        "AHRS: EK3_MAG_CAL and EK3_SRC1_YAW inconsistent",
        "`EK3_MAG_CAL` is an old way to ask for external yaw",
        "`EK3_MAG_CAL`",
        "set `EK3_MAG_CAL` to 3, and `EK3_SRC1_YAW` to 6",
    ),
    Text(
        "AHRS: waiting for home",
        "the mode needs a position (Loiter, Guided, Auto), and there is no home: no origin was set; since 2026-02 only "
        "if the EKF uses GPS",
        "whether GPS_GLOBAL_ORIGIN was ever sent",
        "indoors set the origin once after each start, before the first pose or where z is 0: `SET_GPS_GLOBAL_ORIGIN`, "
        'in Mission Planner "Set EKF Origin Here"; home follows by itself once there is a position. Or arm in '
        "Stabilize or AltHold",
    ),
    Text(
        "Need Position Estimate",
        "the mode needs a position, and the filter has none",
        "`EKF3 IMU0 is using external nav data` must have come",
        "let it fuse external navigation first; `EK3_SRC1_POSXY` or `VELXY` has to be 6. Or arm in Stabilize or "
        "AltHold",
        ("XN9-15",),
    ),
    Text(
        "Need Alt Estimate",
        "the mode holds height, and the filter has none",
        "`EK3_SRC1_POSZ`",
        "wait until it is aligned",
    ),
    Text(
        "EKF attitude is bad",
        "the filter's tilt or yaw is not aligned",
        "`EK3_SRC1_YAW`",
        "wait; if the text stays, the filter gets no yaw",
        ("XN7-08",),
    ),
    Text(
        "EKF {compass} variance",
        "a test ratio is above `FS_EKF_THRESH`: of compass (any yaw), position, velocity or height",
        "the innovation of that kind (XKF3)",
        "hold still; correct what disagrees",
        ("XN9-10", "XN9-11"),
    ),
    Text(
        "AHRS not healthy",
        "the filter is not healthy at the moment of arming",
        "`core 0 unhealthy`",
        "as for `core 0 unhealthy`",
    ),
    Text("GPS glitching", "the filter has just rejected GPS positions", "XKF4.SP", "wait until they agree"),
)
GPS: Final = (
    Text(
        "GPS {1}: Bad fix",
        "`GPS_INPUT` or the simulated receiver has no 3D fix",
        "`GPS_RAW_INT`",
        "`GPS1_TYPE` 0, or send a fix of 3 or more",
    ),
    Text("GPS {1}: not healthy", "its solutions come late or too seldom", "their rate", "send at 5 Hz or more"),
    Text(
        "GPS positions differ by 60.0m",
        "two receivers are 50 m or more apart",
        "`GPS_RAW_INT`, `GPS2_RAW`",
        "`GPS2_TYPE` 0, or wait until both have a good fix",
    ),
    Text(
        "GPS and AHRS differ by 12.0m",
        "the positions of receiver and filter differ by 10 m or more",
        "where the origin is",
        "set the origin where the vehicle is",
        ("XN7-32",),
    ),
    Text("High GPS HDOP", "the dilution is above `GPS_HDOP_GOOD`", "`GPS_RAW_INT`", "send a lower `hdop`"),
    Text("AHRS: Waiting for 3D fix", "the filter waits for GPS", "`EK3_SRC1_POSXY`", "`GPS1_TYPE` 0, or send a fix"),
    Text("AHRS: EKF starting GPS checks", "the filter checks GPS for 10 s", "nothing", "wait"),
    Text(
        "AHRS: GPS drift 4.0m (needs 3.0)",
        "the GPS position drifts although the vehicle stands still",
        "the sky",
        "bits of `EK3_GPS_CHECK` choose the checks",
    ),
    Text(
        "AHRS: GPS vertical speed 0.40m/s (needs 0.30)",
        "GPS reports vertical motion on the ground",
        "the sky",
        "likewise",
    ),
    Text(
        "AHRS: GPS horizontal speed 4.00m/s (needs 0.30)",
        "GPS reports horizontal motion on the ground; the number is the drift",
        "the sky",
        "likewise",
    ),
    Text(
        "AHRS: GPS horiz error 6.0m (needs 5.0)",
        "its own estimate of its horizontal error is large",
        "the sky",
        "likewise",
    ),
    Text("AHRS: GPS vert error 8.0m (needs < 7.5)", "likewise, vertical", "the sky", "likewise"),
    Text("AHRS: GPS speed error 1.2 (needs < 1.0)", "likewise, of its velocity", "the sky", "likewise"),
    Text("AHRS: GPS HDOP 3.0 (needs 2.5)", "the dilution is large", "the sky", "likewise"),
    Text("AHRS: GPS numsats 5 (needs 6)", "it sees few satellites", "the sky", "likewise"),
    Text(
        "AHRS: Mag yaw error x=1.2 y=0.4",
        "the compass does not agree with the filter",
        "XKF3.IMX and IMY",
        "likewise; or take yaw from external navigation",
    ),
)
VEHICLE: Final = (
    Text("System not initialised", "booting takes 2.5 s", "nothing", "wait"),
    Text(
        "Hardware safety switch",
        "the safety switch is on",
        "the switch",
        "`MAV_CMD_DO_SET_SAFETY_SWITCH_STATE`, or the ground station's safety button",
    ),
    Text("Safety Switch", "the same, at an attempt to arm", "the switch", "the same"),
    Text(
        "Logging failed",
        "the log cannot be written: the disk is full, or the folder is not writable",
        "the card",
        "make room; a new log is tried every 5 s",
    ),
    Text("Logging not started", "the log of the flight could not be opened", "the card", "the same"),
    Text("Downloading logs", "somebody downloads a log", "other ground stations", "wait, or end the download"),
    Text("Mode requires mission", "the mode is Auto, and there is no mission", "the mission", "upload one"),
    Text(
        "{Loiter} mode not armable",
        "the firmware does not arm in this mode: RTL, Land, Auto and others",
        "the mode",
        "another mode; Auto arms with bit 0 of AUTO_OPTIONS",
    ),
    Text(
        "Leaning",
        "the vehicle leans by 30 degrees or more",
        "ATTITUDE",
        "level it; in a simulation check the attitude that its sensors follow",
    ),
    Text(
        "Rangefinder 1: No Data",
        "`RNGFND1_TYPE` is set, and no measurement has arrived lately",
        "DISTANCE_SENSOR",
        "send `DISTANCE_SENSOR`, or set it to 0",
        ("XNR-01",),
    ),
    Text("Rangefinder 1: Not Connected", "likewise, for a long time", "likewise", "the same", ("XNR-01",)),
    Text(
        "Rangefinder 1: Not Detected",
        "viso does not emulate this `RNGFND1_TYPE`, or it is analog and has no pin",
        "`RNGFND1_TYPE`, `RNGFND1_PIN`",
        "10 is MAVLink; with `--imu fly` 100 is the simulator's, and so is 1 with pin 0",
    ),
    Text(
        "RNGFND1_PIN not set",
        "an analog range finder has lost its pin",
        "`RNGFND1_PIN`",
        "set it to 0, the pin of the simulator's range finder",
    ),
    Text(
        "Internal errors 0x10 l:12 flow_of_ctrl",
        "a state that the firmware considers impossible, such as an attitude that is not finite",
        "NaN in your messages",
        "leave such messages out; a restart clears the error",
        ("XN5-01", "XN5-02"),
    ),
)
OTHERS: Final = (
    Text("ArduPilot Ready", "booting has ended", "nothing", "nothing"),
    Text("{ArduCopter V4.7.0 (0932dd82)}", "the banner: version, system id and frame", "the version", "nothing"),
    Text("Arming motors", "it is armed", "nothing", "nothing"),
    Text("Disarming motors", "it is disarmed", "nothing", "nothing"),
    Text(
        "Warning: Arming Checks Disabled",
        "all checks are switched off, also that of the camera",
        "ARMING_SKIPCHK, before 4.7 ARMING_CHECK",
        "leave out single checks instead: bit 18 is that of the camera",
    ),
    Text("Param write denied ({STAT_RUNTIME})", "this parameter is the autopilot's own", "its name", "nothing"),
    Text("GPS {1}: specified as MAV", "its GPSn_TYPE is 14: GPS_INPUT is awaited", "nothing", "nothing"),
    Text("GPS {1}: detected MAV", "the first GPS_INPUT came", "nothing", "nothing"),
    Text("GPS {1}: probing for u-blox at 230400 baud", "a receiver sends at this speed", "nothing", "nothing"),
    Text("GPS {1}: detected u-blox", "the receiver's first solution came", "nothing", "nothing"),
    Text(
        "DDS: Received tf2_msgs/TFMessage: TF is empty",
        "a message on /ap/tf held no transform",
        "the publisher",
        "publish transforms",
    ),
    Text(
        "{VISO_TYPE} is {4: viso does not emulate it}",
        "a parameter asks for what viso leaves out, and is in vain here",
        "docs/parity.md",
        "nothing; the autopilot itself may do it",
    ),
    Text(
        "Takeoff refused: nothing moves it; use --imu fly",
        "viso's own: a vehicle at rest cannot take off",
        "`--imu`",
        "viso serve --imu fly",
    ),
    Text("Set FOLL_ENABLE = 1", "the mode is switched off", "FOLL_ENABLE", "another mode"),
    Text("No axis selected, SID_AXIS = 0", "the mode has no axis to excite", "SID_AXIS", "another mode"),
    Text("No such mode 99", "the vehicle has no such mode", "the number", "another mode"),
    Text(
        "Mode change to AUTO RTL failed: No return path or landing sequence found",
        "viso does not look for a landing in the mission",
        "the mission",
        "another mode",
    ),
    Text(
        "Mode change to {FOLLOW} failed: {init failed}",
        "the mode has a condition that is not met",
        "the text before",
        "another mode",
    ),
    Text("Need mavlink2 for item transfer", "the link speaks MAVLink 1", "the client", "speak MAVLink 2"),
    Text("Only 650 items are supported", "the mission, fence or list is too long", "its length", "shorten it"),
    Text("Flight plan received", "a mission was stored", "nothing", "nothing"),
    Text("Flight plan update rejected", "items were to replace some that are not there", "their numbers", "nothing"),
    Text("{Mission} upload timeout", "the client sent no item for 8 s", "the client and the link", "upload again"),
    Text("Clearing Mission", "MIS_OPTIONS bit 0 forgets the mission at start-up", "MIS_OPTIONS", "nothing"),
    Text(
        "Auto: Missing Takeoff Cmd", "on the ground, and the mission goes on with no take-off", "the mission", "add it"
    ),
    Text("Auto mission changed, restarted command", "a client changed what is ahead", "nothing", "nothing"),
    Text(
        "Auto mission changed but failed to restart command", "the same, and the item is gone", "the mission", "nothing"
    ),
    Text("Mission: {1 Takeoff}", "an item of the mission begins", "nothing", "nothing"),
    Text("Mission: 1 Jump 1/{2}", "the mission jumps, for the first of two times", "nothing", "nothing"),
    Text("Mission: starting circle 1/2", "a turn of NAV_LOITER_TURNS begins", "nothing", "nothing"),
    Text("Reached command #1", "a waypoint is reached, and its time over", "nothing", "nothing"),
    Text("Delaying 5 sec", "NAV_DELAY begins", "nothing", "nothing"),
    Text("Skipping invalid cmd #212", "the vehicle does not do this command", "the mission", "leave it out"),
    Text("got MISSION_ITEM; GCS should send MISSION_ITEM_INT", "an old client", "the client", "renew it"),
    Text("got MISSION_REQUEST; use MISSION_REQUEST_INT!", "an old client", "the client", "renew it"),
    Text("ERROR: Won't setup signing when armed", "signing can be set up while disarmed only", "nothing", "disarm"),
    Text("ERROR: Failed to save signing key", "the key could not be stored", "the storage", "make room"),
    Text(
        "Invalid channel option (99)",
        "the auxiliary function is none that viso has",
        "its number",
        "80 aligns the camera, 90 switches sources",
    ),
    Text("All parameters reset, reboot board", "the parameters are forgotten at the next start", "nothing", "restart"),
    Text("Disarm to allow calibration", "it is armed", "nothing", "disarm"),
    Text("Updating barometer calibration", "the barometer is set to 0", "nothing", "nothing"),
    Text("Barometer calibration complete", "the barometer is set to 0", "nothing", "nothing"),
    Text(
        "Unknown mavlink coordinate frame 99",
        "a place came in a frame that is not known",
        "the sender's frame",
        "MAV_FRAME_GLOBAL or GLOBAL_RELATIVE_ALT",
    ),
    Text("No ap_message for mavlink id (99)", "the autopilot does not send this message", "its id", "another message"),
    Text(
        "Requested rate for message ID 99 too fast. Increase SCHED_LOOP_RATE",
        "the interval is below a pass of the loop",
        "the interval",
        "ask for less",
    ),
    Text("Unsupported FTP: 99", "a request of MAVLink FTP that is not known", "the client", "nothing"),
    Text("Disarm for log download", "LOG_DISARMED and arming forbid a download now", "nothing", "disarm"),
    Text("Log download in progress", "somebody downloads a log already", "other clients", "wait"),
)

GROUPS: Final[Mapping[str, tuple[Text, ...]]] = MappingProxyType(
    {
        "in flight": IN_FLIGHT,
        "against arming: external navigation": EXTERNAL_NAVIGATION,
        "against arming: the estimator": ESTIMATOR,
        "against arming: GPS": GPS,
        "against arming: the vehicle": VEHICLE,
        "of the firmware alone": OF_THE_FIRMWARE,
        "others": OTHERS,
    }
)


def all_texts() -> Iterator[tuple[str, Text]]:
    """Yield the group of each text, and the text."""
    for group, texts in GROUPS.items():
        for text in texts:
            yield group, text


def texts_like(words: str) -> list[tuple[str, Text]]:
    """Return the texts that some words are, or else that hold all of them, with their groups."""
    exact = [(group, text) for group, text in all_texts() if text.sample[0] != "{" and text.fits(words)]
    if exact:
        return exact
    wanted = without_beginning(words).lower().split()
    return [(group, text) for group, text in all_texts() if all(word in text.shown.lower() for word in wanted)]
