# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What releases do otherwise than others: a row for each difference, with the change of the firmware behind it.

A revision is one of the firmware's master, and its date is that of the merge.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from ap_visualodom.release import (
    axes_requested,
    no_axes,
    position_as_scaled,
    position_with_correction,
    vel_err_of_message,
    vel_err_of_parameter,
)
from mav_handlers.covariance import (
    cube_root_of_squares,
    no_errors,
    no_velocity_error,
    pose_errors,
    root_of_sum,
    velocity_error,
)
from mav_handlers.params.names import options_of_link, options_of_port
from mav_handlers.release import is_any_default, is_factory_default
from viso.firmware.releases import Firmware
from viso.parameters import sensors


class Upstream(NamedTuple):
    """A change of the firmware: 10 hex digits of its revision, and the day on which master got it."""

    revision: str
    date: str

    def __str__(self) -> str:
        """Return it for people."""
        return f"{self.revision}, {self.date}"


@dataclass(frozen=True, slots=True)
class Difference:
    """Something that releases do otherwise than others.

    Attributes:
        topic: what it belongs to.
        what: what it is.
        of: takes a release, returns what that does.
        field: the field of the release's tables that says so, such as ``ekf.fuses_rest``.
        upstream: the changes behind it, the oldest first.
        is_recorded: whether recordings show it; else it was read in the source.
    """

    topic: str
    what: str
    of: Callable[[Firmware], str]
    field: str
    upstream: tuple[Upstream, ...]
    is_recorded: bool = False

    @property
    def source(self) -> str:
        """The changes behind it."""
        return "; ".join(map(str, self.upstream))

    def as_dict(self, one: Firmware, other: Firmware) -> dict[str, object]:
        """Return what two releases do, for machine-readable output."""
        changes = [{"revision": change.revision, "date": change.date} for change in self.upstream]
        before, after = (self.of(release).replace("`", "") for release in (one, other))
        return {"topic": self.topic, "what": self.what, "before": before, "after": after, "by": changes}


_TEXTS: Final[Mapping[Callable[..., object], str]] = {
    axes_requested: "T265 and VOXL: the axes of the request",
    no_axes: "none in any backend",
    position_as_scaled: "as scaled",
    position_with_correction: "as scaled, but 0 for -0",
    vel_err_of_parameter: "`VISO_VEL_M_NSE`",
    vel_err_of_message: "the velocity's own, at least `VISO_VEL_M_NSE`",
    cube_root_of_squares: "the cube root of the sum of squared variances, which is no standard deviation",
    root_of_sum: "the root of the sum of variances",
    no_errors: "not read",
    pose_errors: "read, as that of ODOMETRY",
    no_velocity_error: "not read",
    velocity_error: "the root of the sum of variances",
    is_factory_default: "2",
    is_any_default: "2 or 4",
    options_of_port: "`SERIALn_OPTIONS`",
    options_of_link: "`MAVn_OPTIONS`",
}
"""What the functions do that are a release's choice."""


def _named(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names) or "none"


def _further(firmware: Firmware) -> Iterator[str]:
    flow = [row for row in firmware.params.flow if row not in sensors.FLOW]
    camera = [row for row in firmware.params.vicon if row not in sensors.VICON_IN_4_6]
    further = ("AHRS_", firmware.params.more_ahrs), ("STAT", firmware.params.more_stat), ("FLOW", flow)
    for prefix, rows in (*further, ("SIM_VICON_", camera)):
        yield from (prefix + row.name for row in rows)
    yield firmware.params.simulated_gps_prefix + firmware.params.simulated_gps[0].name
    yield "SIM_GPS2_" + firmware.params.second_simulated_gps[0].name


_LIBRARY, _ENDPOINT, _SENSORS, _FILTER, _VEHICLE = "AP_VisualOdom", "MAVLink", "AP_OpticalFlow", "EKF3", "Copter"
_PARAMETERS, _LOG, _ROS = "parameters", "log", "ROS 2"

_ALIGNMENT: Final = (Upstream("e03eede3ae", "2025-07-22"),)
_VELOCITY_COVARIANCE: Final = (Upstream("745a0d05a7", "2026-03-20"), Upstream("c63c51ea3d", "2026-03-20"))
_MAV_NAMESPACE: Final = (Upstream("594d78ce6f", "2025-04-07"),)


def _answer(what: str, yes: str, no: str, name: str, *upstream: Upstream) -> Difference:
    """Return a row of EndpointRelease that has one of two values; what it does was read."""
    return Difference(
        _ENDPOINT, what, lambda one: yes if getattr(one.endpoint, name) else no, f"endpoint.{name}", upstream
    )


def _flag(what: str, name: str, *upstream: Upstream, is_recorded: bool = False) -> Difference:
    """Return a row of FilterRelease that a release has or has not."""
    return Difference(
        _FILTER, what, lambda one: "yes" if getattr(one.ekf, name) else "no", f"ekf.{name}", upstream, is_recorded
    )


ERROR_FORMULA: Final = Difference(
    _ENDPOINT,
    "error from a covariance",
    lambda one: _TEXTS[one.endpoint.error_formula],
    "endpoint.error_formula",
    (Upstream("0122854151", "2026-02-05"),),
    is_recorded=True,
)
MOCAP_ERRORS: Final = Difference(
    _ENDPOINT,
    "covariance of ATT_POS_MOCAP",
    lambda one: _TEXTS[one.endpoint.mocap_errors],
    "endpoint.mocap_errors",
    (Upstream("ab0bd00d92", "2026-02-05"),),
    is_recorded=True,
)

DIFFERENCES: Final[tuple[Difference, ...]] = (
    Difference(
        _LIBRARY,
        "position alignment to the AHRS",
        lambda one: _TEXTS[one.visual_odom.axes_to_align],
        "visual_odom.axes_to_align",
        _ALIGNMENT,
        is_recorded=True,
    ),
    Difference(
        _LIBRARY,
        "position of the MAV backend",
        lambda one: _TEXTS[one.visual_odom.mav_position],
        "visual_odom.mav_position",
        _ALIGNMENT,
        is_recorded=True,
    ),
    Difference(
        _LIBRARY,
        "error of a velocity in the MAV backend",
        lambda one: _TEXTS[one.visual_odom.mav_vel_err],
        "visual_odom.mav_vel_err",
        _VELOCITY_COVARIANCE,
        is_recorded=True,
    ),
    ERROR_FORMULA,
    MOCAP_ERRORS,
    Difference(
        _ENDPOINT,
        "covariance of VISION_SPEED_ESTIMATE",
        lambda one: _TEXTS[one.endpoint.velocity_error],
        "endpoint.velocity_error",
        _VELOCITY_COVARIANCE,
        is_recorded=True,
    ),
    Difference(
        _ENDPOINT,
        "what cannot be read or set",
        lambda one: "PARAM_ERROR" if one.endpoint.tells_param_errors else "no answer",
        "endpoint.tells_param_errors",
        (Upstream("648db856f8", "2025-10-18"),),
        is_recorded=True,
    ),
    Difference(
        _ENDPOINT,
        "an origin that a client sets",
        lambda one: (
            "GPS_GLOBAL_ORIGIN to the client, then the texts, then GPS_GLOBAL_ORIGIN to all as home follows"
            if one.endpoint.sends_origin_at_once
            else "the texts, then GPS_GLOBAL_ORIGIN to all"
        ),
        "endpoint.sends_origin_at_once",
        (Upstream("856f14f68b", "2026-02-05"),),
        is_recorded=True,
    ),
    Difference(
        _ENDPOINT,
        "field of HIGHRES_IMU",
        lambda one: f"mGauss times {one.endpoint.highres_field_scale:g}",
        "endpoint.highres_field_scale",
        (Upstream("6ab41a9ae3", "2026-02-25"),),
    ),
    Difference(
        _ENDPOINT,
        "param1 of PREFLIGHT_STORAGE that erases all parameters",
        lambda one: _TEXTS[one.endpoint.resets_parameters],
        "endpoint.resets_parameters",
        (Upstream("d394a0b390", "2026-03-16"),),
    ),
    _answer(
        "MAV_CMD_REQUEST_MESSAGE of MESSAGE_INTERVAL",
        "answered",
        "refused",
        "tells_interval_on_request",
        Upstream("d1b81b1505", "2025-04-21"),
    ),
    _answer("an origin of 0, 0, 0", "refused", "taken", "refuses_zero_origin", Upstream("e85dbced46", "2025-05-02")),
    Difference(
        _ENDPOINT,
        "altitude in SET_GPS_GLOBAL_ORIGIN",
        lambda one: "any" if (most := one.endpoint.most_origin_alt_mm) is None else f"up to {most / 1e6:g} km",
        "endpoint.most_origin_alt_mm",
        (Upstream("700d118a4e", "2025-10-12"),),
    ),
    Difference(
        _ENDPOINT,
        "messages that it does not know",
        lambda one: _named(sorted(one.endpoint.unknown_messages)),
        "endpoint.unknown_messages",
        (
            Upstream("26152416ab", "2024-11-13"),
            Upstream("55936895e3", "2024-11-26"),
            Upstream("e746ae13db", "2025-03-17"),
            Upstream("b85714b95e", "2025-09-29"),
        ),
    ),
    Difference(
        _ENDPOINT,
        "messages that no stream group has",
        lambda one: _named(sorted(one.endpoint.unstreamed)),
        "endpoint.unstreamed",
        (Upstream("75d055e81a", "2025-10-07"),),
    ),
    Difference(
        _ENDPOINT,
        "MAV_CMD_DO_SET_GLOBAL_ORIGIN",
        lambda one: "unknown" if one.endpoint.unknown_commands else "known",
        "endpoint.unknown_commands",
        (Upstream("e85dbced46", "2025-05-02"),),
    ),
    _answer(
        "restart of another component",
        "restarts the autopilot",
        "does not",
        "reboots_for_others",
        Upstream("8be74753a5", "2025-11-18"),
    ),
    _answer(
        "dropped packets and log messages in SYS_STATUS",
        "counted",
        "0",
        "counts_drops",
        Upstream("31ed42f873", "2025-05-29"),
        Upstream("b6157591ec", "2025-06-03"),
    ),
    Difference(
        _ENDPOINT,
        "fields_updated of HIGHRES_IMU",
        lambda one: f"{one.endpoint.all_sensors_updated:#x}",
        "endpoint.all_sensors_updated",
        (Upstream("a81c79a1b0", "2025-02-10"),),
    ),
    Difference(
        _ENDPOINT,
        "silence of telemetry over its delay",
        lambda one: f"{1.024 * one.endpoint.telem_delay_more:g} s",
        "endpoint.telem_delay_more",
        (Upstream("282a737c5d", "2025-04-07"),),
    ),
    _answer(
        "MAV_CMD_DO_CHANGE_SPEED without a speed",
        "DENIED",
        "FAILED",
        "refuses_speed_of_0",
        Upstream("f91d001803", "2025-07-08"),
    ),
    _answer("names of flight modes", "words", "capitals", "spells_modes_out", Upstream("56ba113f0b", "2026-01-19")),
    _answer(
        "modes that a user cannot select in AVAILABLE_MODES",
        "marked",
        "not marked",
        "lists_selectable_modes",
        Upstream("c500ce1a13", "2026-02-16"),
    ),
    _answer(
        "calibration of a barometer",
        "in progress, then done",
        "done",
        "calibrates_in_steps",
        Upstream("a7dc2bac36", "2025-05-22"),
    ),
    _answer(
        "home as an item of the mission",
        "counts",
        "does not count",
        "counts_home",
        Upstream("2c816c8841", "2025-01-28"),
    ),
    _answer(
        "request for an item that does not exist",
        "answered by the kind of mission",
        "out of sequence",
        "tells_bad_items_by_type",
        Upstream("4161c425d1", "2025-02-06"),
    ),
    _answer(
        "time at a waypoint below 0 or above 65535 s",
        "refused",
        "taken",
        "checks_waypoint_delay",
        Upstream("96310b82a3", "2026-01-28"),
    ),
    _answer(
        "jump of a mission that is met again after it was done as often as asked for",
        "jumps as often again",
        "does not jump",
        "repeats_jumps",
        Upstream("c9661c27a4", "2025-04-17"),
    ),
    _answer(
        "GPS_RAW_INT with GPS1_TYPE 0",
        "sent",
        "not sent",
        "sends_disabled_gps",
        Upstream("2462e70118", "2025-10-14"),
    ),
    _answer(
        "target in GUIDED that asks for a force",
        "makes the vehicle hold",
        "does nothing",
        "stops_at_forces",
        Upstream("3038c70637", "2025-05-31"),
    ),
    Difference(
        _SENSORS,
        "flow of OPTICAL_FLOW",
        lambda one: (
            "`flow_rate_x` and `flow_rate_y` in rad/s once one is not zero; before, as earlier releases"
            if one.reads_flow_rates
            else "`flow_x` and `flow_y` times the period"
        ),
        "reads_flow_rates",
        (Upstream("9e2d679d94", "2025-07-22"),),
        is_recorded=True,
    ),
    _flag(
        "aiding resets height only to the source of height",
        "resets_height_by_its_source",
        Upstream("ce15217c17", "2026-03-25"),
        is_recorded=True,
    ),
    _flag(
        "an origin that is set before EKF3 has a state is refused, and no longer lost in silence",
        "refuses_early_origin",
        Upstream("7de88b5f5a", "2026-03-25"),
    ),
    _flag(
        "relative aiding goes on without a source of yaw", "relative_needs_no_yaw", Upstream("8127c10477", "2026-02-24")
    ),
    _flag(
        "EKF3 holds a vehicle that stands still to have no velocity",
        "fuses_rest",
        Upstream("466e7f0b9c", "2026-04-08"),
        is_recorded=True,
    ),
    _flag("EK3_MAG_CAL has 7", "learns_field_on_ground", Upstream("6774c1b31e", "2026-03-31")),
    _flag(
        "accelerometer biases that are not learned are apart from the others",
        "forgets_frozen",
        Upstream("daf6fbfdfd", "2026-02-05"),
    ),
    _flag("the GSF's tilt counts accelerometers below 1 g", "gsf_asks_load", Upstream("aa740bb239", "2026-02-17")),
    _flag(
        "what a camera says has the accuracies of a GPS that gives any",
        "weighs_as_gps",
        Upstream("104c7f84bf", "2025-04-22"),
        is_recorded=True,
    ),
    _flag(
        "with few satellites a camera counts for less, too",
        "scales_all_noise",
        Upstream("d74a457d7e", "2025-04-22"),
        is_recorded=True,
    ),
    _flag(
        "vertical velocity is fused whatever EK3_SRCn_VELZ says",
        "fuses_any_climb",
        Upstream("4d99848b44", "2025-06-26"),
        is_recorded=True,
    ),
    _flag(
        "on the ground a compass that stands in for another is kept",
        "keeps_compass",
        Upstream("c242e557bb", "2025-04-15"),
    ),
    _flag(
        "EK3_OPTIONS cannot leave the choice of cores to the user",
        "lanes_are_automatic",
        Upstream("e45a7540af", "2025-04-23"),
    ),
    _flag(
        "EK3_SRC_OPTIONS aligns a camera to flow even if it is in use",
        "aligns_source_in_use",
        Upstream("d2faaab299", "2025-07-01"),
    ),
    _flag(
        "arming asks for an AHRS_EKF_TYPE that the vehicle takes as it is",
        "checks_estimator_number",
        Upstream("a8b57dcead", "2025-12-01"),
        is_recorded=True,
    ),
    _flag(
        "EK3_SRC_OPTIONS cannot give each core a source set of its own",
        "shares_source_set",
        Upstream("f172c2fd03", "2025-07-01"),
    ),
    Difference(
        _FILTER,
        "ranges, also in its log",
        lambda one: "whole centimetres" if one.params.range_unit.is_cm else "metres",
        "params.range_unit",
        (Upstream("b633084df3", "2025-01-21"),),
        is_recorded=True,
    ),
    Difference(
        _VEHICLE,
        "FS_EKF_ACTION 0",
        lambda one: "reports" if one.reports_ekf_failure else "lands",
        "reports_ekf_failure",
        (Upstream("52363a564e", "2025-06-03"),),
    ),
    Difference(
        _VEHICLE,
        "GPS that arming asks for, in modes with a position",
        lambda one: "any" if one.checks_unused_gps else "one that the active source set uses",
        "checks_unused_gps",
        (Upstream("6eafa4766e", "2026-02-05"),),
    ),
    Difference(
        _VEHICLE,
        "origin kept in parameters",
        lambda one: "bits 3, 4 of `AHRS_OPTIONS`" if one.keeps_origin else "no",
        "keeps_origin",
        (Upstream("d8a9394aac", "2026-02-05"),),
    ),
    Difference(
        _VEHICLE,
        "EKF failsafe",
        lambda one: " or ".join(f"`{text}`" for text in dict.fromkeys(one.variance_texts)),
        "variance_texts",
        (Upstream("41b6c05199", "2026-03-09"),),
    ),
    Difference(
        _PARAMETERS,
        "system id",
        lambda one: f"`{one.endpoint.params.system_id}`",
        "endpoint.params",
        _MAV_NAMESPACE,
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "ground station's id",
        lambda one: f"`{one.endpoint.params.ground_station_id}`",
        "endpoint.params",
        _MAV_NAMESPACE,
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "last of several such ids",
        lambda one: f"`{one.endpoint.params.last_ground_station_id or '-'}`",
        "endpoint.params",
        (Upstream("5b05a7dc2a", "2025-07-29"),),
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "obey that alone",
        lambda one: f"`{one.endpoint.params.only_ground_station}`",
        "endpoint.params",
        _MAV_NAMESPACE,
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "silence after start-up",
        lambda one: f"`{one.endpoint.params.telem_delay}`",
        "endpoint.params",
        _MAV_NAMESPACE,
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "rates of the first link",
        lambda one: f"`{one.endpoint.params.stream_rate(0, '_...')}`",
        "endpoint.params",
        _MAV_NAMESPACE,
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "options of a link",
        lambda one: _TEXTS[one.endpoint.params.link_options],
        "endpoint.params",
        (Upstream("687c5d38f0", "2025-06-03"),),
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "limits of range finders",
        lambda one: f"`RNGFND1_{one.params.range_unit.least}`, `RNGFND1_{one.params.range_unit.most}`",
        "params.range_unit",
        (Upstream("fb7925d029", "2025-01-21"),),
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "default of `SIM_SPEEDUP`",
        lambda one: f"{one.params.simulation[0].default:g}",
        "params.simulation",
        (Upstream("f7c0bf6bcc", "2025-06-03"),),
    ),
    Difference(
        _PARAMETERS,
        "limit of optical flow",
        lambda one: f"`EK3_{one.params.flow_limit}`",
        "ekf.flow_limit",
        (Upstream("dbd6c0bd56", "2025-07-24"),),
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "arming checks",
        lambda one: f"`ARMING_{one.params.arming_check}`",
        "params.arming_check",
        (Upstream("436047600a", "2025-12-04"),),
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "speed, height and lean",
        lambda one: _named(one.params.flying.sources[name][0] for name in ("WPNAV_SPEED", "RTL_ALT", "ANGLE_MAX")),
        "params.flying",
        (
            Upstream("5e32cdffc7", "2026-01-23"),
            Upstream("40584a1cf1", "2026-01-28"),
            Upstream("6991d8e30d", "2026-02-24"),
        ),
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "parameters that others lack",
        lambda one: _named(_further(one)),
        "params.more_ahrs",
        (
            Upstream("f0cd34af2b", "2025-04-15"),
            Upstream("b3a5cde30e", "2025-07-22"),
            Upstream("51dd871d00", "2025-07-26"),
            Upstream("1eff2e9507", "2025-11-02"),
            Upstream("666b4e0e32", "2026-01-24"),
            Upstream("d8a9394aac", "2026-02-05"),
        ),
        is_recorded=True,
    ),
    Difference(
        _PARAMETERS,
        "EK3_SRC_OPTIONS by default",
        lambda one: f"{one.params.source_options}",
        "params.source_options",
        (Upstream("c678ce436e", "2025-07-08"),),
        is_recorded=True,
    ),
    Difference(
        _LOG,
        "replay records of an event",
        lambda one: _named(record.name for record in one.event_order),
        "event_order",
        (Upstream("8fdc12ab2e", "2026-02-02"),),
        is_recorded=True,
    ),
    Difference(
        _LOG,
        "camera's place and delay in `RBOH`",
        lambda one: "yes" if one.log.fills_odometry else "0",
        "log.fills_odometry",
        (Upstream("57b7cf584d", "2026-03-30"),),
        is_recorded=True,
    ),
    Difference(
        _LOG,
        "index of the channel or link in `AUXF`",
        lambda one: "yes" if one.log.has_index_of_aux_function else "no",
        "log.has_index_of_aux_function",
        (Upstream("9ebb87816a", "2024-12-20"),),
    ),
    Difference(
        _LOG,
        "texts in a log",
        lambda one: f"`{one.log.message.labels}`",
        "log.message",
        (Upstream("cf29484f7d", "2025-12-17"),),
        is_recorded=True,
    ),
    Difference(
        _LOG,
        "version of the filter in a log",
        lambda one: f"{one.log.filter_version}",
        "log.filter_version",
        (Upstream("c3d35c0a2d", "2025-09-25"),),
        is_recorded=True,
    ),
    Difference(
        _LOG,
        "ids of records that are greater than the reference's",
        lambda one: ", ".join(f"from {first} on by {by}" for first, by in one.log.shifts if by) or "none",
        "log.shifts",
        (
            Upstream("c0a8b635a6", "2025-08-13"),
            Upstream("36d5311cb1", "2026-01-27"),
            Upstream("9c78d4621c", "2026-03-16"),
            Upstream("124881cee7", "2026-03-27"),
        ),
        is_recorded=True,
    ),
    Difference(
        _ROS,
        "covariances of an IMU",
        lambda one: f"begin with {one.dds.unknown_covariance:g}",
        "dds.unknown_covariance",
        (Upstream("54f1694968", "2025-10-08"),),
    ),
    Difference(
        _ROS,
        "status without a change",
        lambda one: f"every {one.dds.status_again_ms} ms" if one.dds.status_again_ms else "not sent",
        "dds.status_again_ms",
        (Upstream("8d84605e93", "2025-10-19"),),
    ),
)
"""All of them, by topic."""


def differences_between(one: Firmware, other: Firmware) -> tuple[Difference, ...]:
    """Return what two releases do otherwise with messages and in the filter: not what they call or log otherwise."""
    rows = (row for row in DIFFERENCES if row.topic not in (_PARAMETERS, _LOG, _ROS))
    return tuple(row for row in rows if row.of(one) != row.of(other))
