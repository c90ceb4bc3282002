# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Angles in another number or of the wrong sign, quaternions in another order: named; flights in order: nothing."""

import re
from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest

from mav_handlers.wire.messages import SCALED_PRESSURE
from tests.places import DATA
from tests.unit.viso.doctor.made_flights import BOOT_S, COPTER, PARAMS, Floats, Motion, judged, telemetry
from viso.doctor import CHECKS, Finding, Severity, diagnose, gather
from viso.estimators.angles import carriers
from viso.geometry.rotation import inverse, quats_from_euler, rotate
from viso.geometry.rotation import product as product_of
from viso.streams.stream_kinds import Aspect, Stream, read_whole_stream

STRANGERS = DATA / "strangers"
CODES = {"XN2-03", "XN2-08", "XN2-11", "XN2-13", "XN3-11", "XN3-13", "XN5-07"}
OF_AXES = {"XN2-02", "XN2-06", "XN2-07", "XN2-10", "XN2-12", "XN8-05"}
ROVER, SUB = 10, 12
NOISY = Motion(noise_rad=0.005)


def found_in(stream: Stream) -> dict[str, Finding]:
    """Return the findings of axes that are worse than notes."""
    findings = diagnose(judged(stream), [check for check in CHECKS if check.code in OF_AXES | CODES])
    return {one.code: one for one in findings if one.severity is not Severity.NOTE}


def found_in_file(name: str) -> dict[str, Finding]:
    stream = read_whole_stream(STRANGERS / name, 30_000_000)
    return {one.code: one for one in diagnose(gather(stream, is_tried=False), CHECKS)}


@pytest.mark.parametrize(
    ("name", "parts", "fix"),
    [
        ("yaw_opposite", ["the yaw that is sent turns the opposite way (correlation -1.00)"], "send pi/2 - yaw"),
        (
            "pitch_is_yaw",
            ["what is sent as pitch is minus the vehicle's yaw", "what is sent as yaw is minus the vehicle's pitch"],
            "Send as pitch minus what is now sent as yaw, as yaw minus what is now sent as pitch.",
        ),
        (
            "yaw_in_roll",
            ["what is sent as yaw is the vehicle's roll", "what is sent as roll is the vehicle's yaw"],
            "Send as roll what is now sent as yaw, as yaw what is now sent as roll.",
        ),
    ],
)
def test_angles_of_strangers(name: str, parts: list[str], fix: str) -> None:
    findings = found_in_file(f"{name}.tlog.gz")
    assert findings["XN2-12"].severity is Severity.ERROR
    assert all(part in findings["XN2-12"].evidence for part in parts)
    assert fix in findings["XN2-12"].fix
    assert "XN8-05" not in findings


def wrong_in(motion: Motion, order: tuple[int, ...], signs: tuple[int, ...]) -> set[tuple[int, int, int]]:
    """Return angle, number and sign of what is found wrong when angles are sent so."""
    sent_s, vehicle_s = np.arange(0.0, motion.length_s, 0.04), np.arange(0.0, motion.length_s, 0.1)
    rpy = motion.angles(vehicle_s)
    noise = motion.noise_rad * np.random.default_rng(1).standard_normal((len(sent_s), 3))
    sent = (motion.angles(sent_s) + noise)[:, list(order)] * signs
    found = carriers(sent_s * 1e6, sent, vehicle_s * 1e6, rpy, rpy)
    return {(one.angle, one.sent, one.sign) for one in found if not one.is_right}


@pytest.mark.parametrize(
    "motion",
    [
        NOISY,
        pytest.param(Motion(tilt_rad=0.3, yaw_rad=3.0), marks=pytest.mark.slow),
        pytest.param(Motion(tilt_rad=0.001, yaw_rad=0.4), marks=pytest.mark.slow),
    ],
)
def test_each_exchange_and_sign_of_angles_is_found(motion: Motion) -> None:
    for order, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        expected = {
            (angle, number, signs[number])
            for number, angle in enumerate(order)
            if (angle != number or signs[number] < 0) and (angle == 2 or motion.tilt_rad > 0.01)
        }
        assert wrong_in(motion, order, signs) == expected


@pytest.mark.parametrize("angle", ["roll", "pitch", "yaw"])
def test_one_sign_is_named_with_what_to_send(angle: str) -> None:
    signs = [-1 if name == angle else 1 for name in ("roll", "pitch", "yaw")]
    finding = found_in(telemetry(motion=NOISY, angles=lambda rpy: rpy * signs))["XN2-12"]
    assert f"the {angle} that is sent turns the opposite way" in finding.evidence
    assert finding.fix.startswith(f"Send as {angle} minus what is now sent as {angle}.")


def test_wrong_angles_that_nothing_uses_are_a_note() -> None:
    stream = telemetry(motion=NOISY, angles=lambda rpy: -rpy, params={**PARAMS, "EK3_SRC1_YAW": 1.0})
    findings = {one.code: one for one in diagnose(judged(stream), CHECKS)}
    assert findings["XN2-12"].severity is Severity.NOTE


@pytest.mark.parametrize(
    ("kind", "attitude_hz"),
    [("VISION_POSITION_ESTIMATE", 4.0), pytest.param("ODOMETRY", 10.0, marks=pytest.mark.slow)],
)
@pytest.mark.parametrize(
    "motion",
    [
        Motion(),
        Motion(noise_rad=0.02),
        Motion(yaw_rad=0.05),
        Motion(yaw_rad=0.0, tilt_rad=0.0, noise_rad=0.01),
        Motion(yaw_rad=3.0, tilt_rad=0.4),
        Motion(length_s=8.0),
        Motion(tilt_rad=0.001, yaw_rad=0.4, noise_rad=0.03),
    ],
)
def test_flight_in_order_gives_no_finding_of_axes(motion: Motion, kind: str, attitude_hz: float) -> None:
    late = telemetry(kind, motion, delay_s=lambda time_s: np.full_like(time_s, 0.12), attitude_hz=attitude_hz)
    assert OF_AXES & found_in(late).keys() == set()


@pytest.mark.parametrize("number", [0.0, np.nan])
def test_sender_of_positions_alone_has_no_angles_to_exchange(number: float) -> None:
    assert "XN2-12" not in found_in(telemetry(angles=lambda rpy: np.full_like(rpy, number)))


@pytest.mark.parametrize(
    ("order", "is_inverse", "name"),
    [
        ((1, 2, 3, 0), False, "x, y, z, w"),
        ((1, 2, 3, 0), True, "x, y, z, w, of the inverse rotation"),
        ((0, 3, 2, 1), False, "w, z, y, x"),
    ],
)
def test_order_of_a_quaternion_is_named(order: tuple[int, ...], is_inverse: bool, name: str) -> None:
    def sent(quats: Floats) -> Floats:
        return np.asarray((quats * [1, *(-1 if is_inverse else 1,) * 3])[:, list(order)])

    findings = found_in(telemetry("ATT_POS_MOCAP", NOISY, quats=sent))
    assert findings["XN2-10"].evidence.endswith(f"if q is read as {name}")
    assert OF_AXES & findings.keys() == {"XN2-10"}


def test_inverse_quaternion_turns_the_opposite_way() -> None:
    finding = found_in(telemetry("ODOMETRY", NOISY, quats=lambda quats: quats * [1, -1, -1, -1]))["XN2-12"]
    assert "the yaw that is sent turns the opposite way" in finding.evidence
    assert "there send its inverse" in finding.fix


def test_centimetres_of_strangers_are_faster_than_a_copter_that_leans_so_little() -> None:
    finding = found_in_file("centimetres.tlog.gz")["XN5-07"]
    assert finding.severity is Severity.ERROR
    assert "58 m/s at a lean of 4 deg" in finding.evidence
    assert "as centimetres its speed would be 0.58 m/s" in finding.evidence


@pytest.mark.parametrize("factor", [100.0, 1000.0])
def test_positions_that_are_not_metres_are_found(factor: float) -> None:
    assert "XN5-07" in found_in(telemetry(places=lambda path: path * factor))


@pytest.mark.parametrize(
    ("motion", "vehicle"),
    [
        (Motion(), COPTER),
        (Motion(size_m=30.0, tilt_rad=0.2), COPTER),
        (Motion(size_m=0.0, tilt_rad=0.0, yaw_rad=0.0), COPTER),
        (Motion(size_m=60.0, tilt_rad=0.0), ROVER),
    ],
)
def test_positions_in_metres_are_left_alone(motion: Motion, vehicle: int) -> None:
    assert CODES & found_in(telemetry(motion=motion, vehicle=vehicle)).keys() == set()


def test_height_upside_down_is_found_by_the_barometer() -> None:
    def flight(sign: float) -> Stream:
        motion = Motion(size_m=20.0)
        time_s = np.arange(0.0, motion.length_s, 0.2)
        down_m = motion.places(time_s)[:, 2]
        pressure = 1000.0 * (1 + down_m / 44330.0) ** (1 / 0.1903)
        baro = [
            (at_s, SCALED_PRESSURE(round((BOOT_S + at_s) * 1e3), hpa, 0.0, 2000))
            for at_s, hpa in zip(time_s.tolist(), pressure.tolist(), strict=True)
        ]
        return telemetry(motion=motion, places=lambda path: path * [1, 1, sign], others=baro)

    assert "XN2-08" in found_in(flight(-1.0))
    assert "XN2-08" not in found_in(flight(1.0))


@pytest.mark.parametrize(("vehicle", "is_found"), [(COPTER, True), (SUB, False)])
def test_take_off_downwards_beside_an_attitude_is_doubted(vehicle: int, is_found: bool) -> None:
    def place(path: Floats) -> Floats:
        return np.column_stack((path[:, :2], np.linspace(-1.0, 4.0, len(path)).clip(0)))

    stream = telemetry(motion=Motion(size_m=0.1), places=place, vehicle=vehicle)
    assert ("XN2-11" in found_in(stream)) == is_found


@pytest.mark.parametrize(
    ("angles", "axis"), [((90.0, 0.0), "y points down"), ((-70.0, 0.0), "y points up"), ((0.0, 100.0), "x points up")]
)
def test_body_on_its_side_is_named_where_nothing_else_shows_the_attitude(
    angles: tuple[float, float], axis: str
) -> None:
    roll, pitch = np.radians(angles)
    turn = quats_from_euler([[roll, pitch, 0.0]])
    stream = telemetry("ATT_POS_MOCAP", attitude_hz=0.01, quats=lambda quats: product_of(quats, turn))
    finding = found_in(stream)["XN2-13"]
    assert axis in finding.evidence
    assert "--axes" in finding.fix
    assert "--mounting" in finding.fix


def test_body_that_leans_lies_not_on_its_side() -> None:
    assert "XN2-13" not in found_in(telemetry("ATT_POS_MOCAP", Motion(tilt_rad=1.2), attitude_hz=0.01))


def test_growing_delay_of_strangers_is_named_with_when_and_how_fast() -> None:
    finding = found_in_file("late_growing.tlog.gz")["XN3-13"]
    assert finding.severity is Severity.ERROR
    rate = re.search(r"grows by (\d+) ms a second", finding.evidence)
    assert rate is not None
    assert int(rate[1]) == pytest.approx(20, abs=2)


@pytest.mark.parametrize(("begun_s", "ms_a_second"), [(0.0, 10.0), (10.0, 30.0), (0.0, 5.0)])
def test_growing_delay_is_found(begun_s: float, ms_a_second: float) -> None:
    def old(time_s: Floats) -> Floats:
        return np.asarray(0.03 + ms_a_second * 1e-3 * np.maximum(time_s - begun_s, 0))

    assert "XN3-13" in found_in(telemetry("ODOMETRY", Motion(noise_rad=0.002), delay_s=old))


@pytest.mark.parametrize(
    "motion",
    [
        pytest.param(NOISY, marks=pytest.mark.slow),
        pytest.param(Motion(noise_rad=0.03), marks=pytest.mark.slow),
        Motion(yaw_rad=0.02, tilt_rad=0.005, noise_rad=0.01),
    ],
)
def test_delay_that_stays_does_not_grow(motion: Motion) -> None:
    rough = np.random.default_rng(3)
    for delay_s in (0.0, 0.35, 0.8):

        def old(time_s: Floats, by_s: float = delay_s) -> Floats:
            return np.asarray(by_s + 0.02 * rough.random(time_s.shape))

        assert "XN3-13" not in found_in(telemetry(motion=motion, delay_s=old))


def test_body_velocities_in_a_log_get_the_fix_of_the_message_that_takes_local_ones() -> None:
    """A log's velocities are read as those of ODOMETRY, so turned back by the attitude."""

    def of_log(stream: Stream) -> Stream:
        return replace(stream, lacks=frozenset({Aspect.LINK}))

    def body(quats: Floats, local: Floats) -> Floats:
        return rotate(inverse(quats), local)

    def body_turned_back(quats: Floats, local: Floats) -> Floats:
        return body(quats, body(quats, local))

    turning = Motion(yaw_rad=2.5, size_m=4.0)
    wrong = found_in(of_log(telemetry("ODOMETRY", turning, velocities=body_turned_back)))["XN2-03"]
    assert "fits the path only if it is in body axes" in wrong.evidence
    assert wrong.fix.startswith("If VISION_SPEED_ESTIMATE is sent, turn the velocity by the attitude")
    assert "XN2-03" not in found_in(of_log(telemetry("ODOMETRY", turning, velocities=body)))
    as_odometry = found_in(of_log(telemetry("ODOMETRY", turning, velocities=lambda _quats, local: local)))["XN2-03"]
    assert "in local axes" in as_odometry.evidence


@pytest.mark.parametrize(("velxy", "severity"), [(0.0, Severity.NOTE), (6.0, Severity.ERROR)])
def test_velocity_of_nan_matters_where_a_source_asks_for_it(velxy: float, severity: Severity) -> None:
    unknown = telemetry("ODOMETRY", params={**PARAMS, "EK3_SRC1_VELXY": velxy})
    findings = diagnose(judged(unknown), [check for check in CHECKS if check.code == "XN5-03"])
    assert [one.severity for one in findings] == [severity]


def test_world_with_y_up_needs_more_than_a_mounting() -> None:
    y_up = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])

    def sent(quats: Floats) -> Floats:
        return np.asarray(product_of(product_of(y_up, quats), inverse(y_up)))

    findings = found_in(telemetry("ATT_POS_MOCAP", Motion(yaw_rad=1.5, tilt_rad=0.2), quats=sent))
    assert {"XN2-06", "XN2-07"} <= findings.keys()
    assert "VISO_ORIENT turns the body alone" in findings["XN2-06"].fix
