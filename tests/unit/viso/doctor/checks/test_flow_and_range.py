# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Flow sensors and range finders: what is planted is named, and sound ones are left in peace."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from mav_handlers.links import make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import DISTANCE_SENSOR, OPTICAL_FLOW, SYS_STATUS
from tests.places import DATA, RECORDED, SHARED
from tests.unit.viso.doctor.evidences import changed
from tests.unit.viso.doctor.ground_flights import (
    FLOW_S,
    START_US,
    Timed,
    evidence_of,
    findings_of,
    flight,
    state_at,
    with_fault,
)
from viso.doctor import CHECKS, Evidence, Finding, Severity, diagnose, gather
from viso.doctor.evidence.flow_fit import fit_flow
from viso.doctor.evidence.ground_sensors import FlowSeries, GroundSensors, rates_by_driver, takes_rates
from viso.doctor.evidence.live import heard_on_link
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.tracks import Floats
from viso.doctor.evidence.vehicle_data import vehicle_of_log
from viso.faults.packet import read_packet
from viso.firmware.releases import JULY_2025, PROFILES, STABLE_4_6, STABLE_4_7, Firmware
from viso.streams.stream import Stream
from viso.streams.stream_kinds import read_whole_stream

LOGS = SHARED.parent / "parity" / "ekf_more"
FLOW, RANGE = "messages: OPTICAL_FLOW", "messages: DISTANCE_SENSOR"
RBD, FLD = (f"kind: axes, {FLOW}, body_axes: {axes}, of: vectors" for axes in ("RBD", "FLD"))


@pytest.fixture(scope="module")
def frames() -> list[Timed]:
    return flight()


@pytest.fixture(scope="module")
def sound(frames: list[Timed]) -> Evidence:
    return evidence_of(frames)


def found_in(evidence: Evidence) -> dict[str, Finding]:
    return {finding.code: finding for finding in findings_of(evidence)}


def test_nothing_is_found_in_a_sound_flight(sound: Evidence) -> None:
    assert findings_of(sound) == []
    (fit,) = sound.flow_fits
    assert fit.factors == pytest.approx((1, 1), abs=0.01)
    assert (round(fit.turned_deg), fit.lag_ms, fit.is_timed) == (0, 0, True)


def further(*values: object) -> object:
    """Return a case that shows nothing which the usual ones do not show, for the long run."""
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("fault", "code", "severity", "said", "fix"),
    [
        (f"kind: fail, {FLOW}", "XNF-01", "warning", "no flow was heard (FLOW_TYPE 5)", "Set FLOW_TYPE"),
        (f"kind: quality, {FLOW}, start_s: 10, end_s: 13", "XNF-03", "warning", "75 of 512 (15 %)", "texture"),
        further(f"kind: quality, {FLOW}", "XNF-03", "error", "quality is 0 in 512 of 512", "texture"),
        (f"kind: fail, {FLOW}, start_s: 12, end_s: 14", "XNF-04", "warning", "gap of 2.0 s from 41.960 s on", "link"),
        further(f"kind: fail, {FLOW}, start_s: 12, end_s: 18", "XNF-04", "error", "gap of 6.0 s", "link"),
        further(f"kind: rate, {FLOW}, rate_hz: 4", "XNF-04", "error", "4.2 measurements per second", "ten"),
        (f"kind: scale, {FLOW}, factor: 1.7", "XNF-05", "error", "about x is 1.70 times", "FLOW_FXSCALER -411"),
        further(f"kind: scale, {FLOW}, factor: 1.3", "XNF-05", "warning", "about y 1.30", "FLOW_FYSCALER -228"),
        further(f"kind: scale, {FLOW}, factor: 8", "XNF-05", "error", "about x is 8.0", "no scaler goes so far"),
        (RBD, "XNF-06", "error", "turned by 90 degrees (clockwise", "FLOW_ORIENT_YAW to about 9000 "),
        (FLD, "XNF-06", "error", "mirrored (x with the wrong sign)", "No FLOW_ORIENT_YAW mends that"),
        (f"kind: delay, {FLOW}, delay_ms: 130", "XNF-07", "warning", "comes 130 ms after", "FLOW_DELAY to about 80"),
        further(f"kind: delay, {FLOW}, delay_ms: 250", "XNF-07", "error", "comes 250 ms after", "about 127"),
        (f"kind: rate, {FLOW}, rate_hz: 10", "XNF-09", "warning", "steps of 0.12 rad/s", "in rad/s"),
        (f"kind: scale, {FLOW}, factor: 8", "XNF-10", "warning", "are above 2.5 rad/s", "Fly slower"),
        (f"kind: frozen, {FLOW}, start_s: 12", "XNF-11", "error", "the same flow for 12.0 s", "Restart"),
        (f"kind: fail, {RANGE}", "XNF-12", "warning", "no range of what looks down was heard", "looks down"),
        further("kind: looks, orientation: 0", "XNR-02", "warning", "there is RNGFND1_ORIENT 25", "orientation 25"),
        ("kind: looks, orientation: 0", "XNR-03", "error", "orientation 0, and none is of orientation 25", "25"),
        ("kind: distance, distance_m: 0.02", "XNR-04", "error", "below the minimum, distances 0.02 to", "RNGFNDn_MIN"),
        further("kind: distance, distance_m: 0.02", "XNF-12", "error", "told no good range", "minimum"),
        (f"kind: fail, {RANGE}, start_s: 12, end_s: 18", "XNR-05", "warning", "time of 6.1 s", "link"),
        further("kind: distance, distance_m: 50, start_s: 12, end_s: 15", "XNR-05", "note", "beyond the", "range"),
        (f"kind: frozen, {RANGE}, start_s: 4", "XNR-06", "error", "height changed by 1.9 m", "Restart"),
        ("kind: distance, distance_m: 20, probability: 0.1", "XNR-07", "warning", "off by up to 19.9 m", "echo"),
        (f"kind: scale, {RANGE}, factor: 0.1", "XNR-08", "error", "grow 0.10 times", "in cm"),
        further(f"kind: scale, {RANGE}, factor: 2", "XNR-08", "error", "grow 2.02 times", "in cm"),
        (f"kind: delay, {RANGE}, delay_ms: 300", "XNR-10", "warning", "about 300 ms later", "at once"),
    ],
)
def test_planted_fault_is_named(frames: list[Timed], fault: str, code: str, severity: str, said: str, fix: str) -> None:
    finding = found_in(evidence_of(with_fault(frames, fault)))[code]
    assert said in finding.evidence
    assert fix in finding.fix
    assert finding.severity == severity


def test_flow_in_coarse_steps_is_named_in_a_release_that_divides_by_the_period(frames: list[Timed]) -> None:
    slow = with_fault(frames, f"kind: rate, {FLOW}, rate_hz: 10")
    finding = found_in(evidence_of(slow, JULY_2025))["XNF-09"]
    assert "steps of 0.12 rad/s" in finding.evidence
    assert "divided by the period" in finding.fix
    assert finding.severity == "warning"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "params"),
    [
        (RBD, {"FLOW_ORIENT_YAW": 9000}),
        (f"kind: scale, {FLOW}, factor: 1.7", {"FLOW_FXSCALER": -411, "FLOW_FYSCALER": -411}),
        (f"kind: delay, {FLOW}, delay_ms: 130", {"EK3_FLOW_DELAY": 80}),
    ],
)
def test_what_the_fix_says_mends_it(fault: str, params: Mapping[str, float]) -> None:
    assert findings_of(evidence_of(with_fault(flight(params), fault))) == []


@pytest.mark.parametrize(
    ("params", "without", "code", "severity", "said"),
    [
        ({"FLOW_TYPE": 0}, (), "XNF-01", "error", "FLOW_TYPE is 0"),
        ({"FLOW_TYPE": 0}, (), "XNF-02", "warning", "600 messages, and FLOW_TYPE is 0"),
        further({"EK3_SRC1_VELXY": 3}, (), "XNF-02", "note", "no EK3_SRCn_VELXY is 5"),
        ({"EK3_SRC1_VELXY": 3, "EK3_SRC2_VELXY": 5, "FLOW_TYPE": 0}, (), "XNF-01", "warning", "EK3_SRC2_VELXY 5"),
        further({"EK3_FLOW_USE": 2}, (), "XNF-01", "error", "EK3_FLOW_USE is 2: it is not to navigate by"),
        ({"RNGFND1_TYPE": 0}, ("DISTANCE_SENSOR",), "XNF-12", "error", "no RNGFNDn_TYPE is set"),
        further(
            {"RNGFND1_TYPE": 0, "EK3_SRC1_POSXY": 3},
            ("DISTANCE_SENSOR",),
            "XNF-12",
            "warning",
            "no RNGFNDn_TYPE is set",
        ),
        ({"RNGFND1_TYPE": 0, "EK3_SRC1_POSZ": 2}, (), "XNR-01", "error", "EK3_SRC1_POSZ 2, and no RNGFNDn_TYPE is set"),
        ({"EK3_SRC1_POSZ": 2}, ("DISTANCE_SENSOR",), "XNR-01", "warning", "no range was heard"),
        further({"EK3_RNG_USE_HGT": 70, "RNGFND1_TYPE": 0}, (), "XNR-01", "warning", "EK3_RNG_USE_HGT 70"),
        ({"RNGFND1_TYPE": 1}, (), "XNR-02", "warning", "no RNGFNDn_TYPE is 10"),
        ({"RNGFND1_MAX": 1}, (), "XNR-05", "note", "beyond the maximum"),
        ({"RNGFND1_MIN_CM": 10000}, (), "XNR-09", "note", "nothing shows a climb"),
        ({}, ("ATTITUDE",), "XNF-14", "note", "nothing tells how the vehicle turned"),
    ],
)
def test_set_up_that_does_not_fit_is_named(
    params: Mapping[str, float], without: tuple[str, ...], code: str, severity: str, said: str
) -> None:
    finding = found_in(evidence_of(flight(params, without=("VISION_POSITION_ESTIMATE", *without))))[code]
    assert said in finding.evidence
    assert finding.severity == severity


@pytest.mark.parametrize(
    ("healthy", "found"),
    [
        (0x140, {"XNF-14": "calls the flow sensor healthy", "XNR-09": "calls the range finder healthy"}),
        (0, dict.fromkeys(("XNF-01", "XNF-12", "XNR-01"), "unhealthy throughout")),
    ],
)
def test_health_of_sensors_that_are_not_heard(healthy: int, found: Mapping[str, str]) -> None:
    status = Codec(1, 1).encode(SYS_STATUS(0x140, 0x140, healthy, *(0,) * 10))
    silent = flight({"EK3_SRC1_POSZ": 2}, without=("OPTICAL_FLOW", "DISTANCE_SENSOR", "VISION_POSITION_ESTIMATE"))
    findings = found_in(evidence_of([*silent, (silent[-1][0], status)]))
    assert set(findings) == set(found)
    assert all(said in findings[code].evidence for code, said in found.items())
    assert {finding.severity for finding in findings.values()} == {"note" if healthy else "error"}


def test_what_is_sent_in_flow_rate_alone_is_not_read(sound: Evidence) -> None:
    (flow,) = sound.vehicle.ground.flows
    assert flow.units is not None
    nothing = np.zeros_like(flow.rate)
    sent = replace(flow, rate=nothing, units=nothing, sent_rate=flow.rate)
    finding = found_in(changed(sound, ground=replace(sound.vehicle.ground, flows=(sent,))))["XNF-09"]
    assert "takes 0 times as much" in finding.evidence
    assert finding.severity is Severity.ERROR


def driven(rates: list[tuple[float, float]], *, reads_rates: bool) -> Floats:
    """Return what the driver takes of messages at certain times with these rates."""
    time_us, sent = np.array([0, 100_000, 300_000, 900_000]), np.array(rates)
    takes = takes_rates(sent) if reads_rates else np.zeros(4, np.bool_)
    scale = {"FLOW_FXSCALER": 500, "FLOW_ORIENT_YAW": 9000}
    return rates_by_driver(np.full((4, 2), (10.0, -10.0)), sent, takes, time_us, scale)


def test_driver_multiplies_by_the_time_since_the_last_flow() -> None:
    for rates, reads_rates in (([(0.4, 0.2)] * 4, False), ([(0.0, 1e-8)] * 4, True)):
        assert driven(rates, reads_rates=reads_rates) == pytest.approx(np.array([(0, 0), (1, 1.5), (2, 3), (0, 0)]))


def test_driver_of_later_releases_takes_rates_from_the_first_on_that_is_not_zero() -> None:
    rates = driven([(0.0, 0.0), (0.0, 0.0), (0.4, 0.2), (0.4, 0.2)], reads_rates=True)
    assert rates == pytest.approx(np.array([(0, 0), (1, 1.5), (-0.2, 0.6), (0, 0)]))
    ended = driven([(0.0, 0.2), (0.0, 0.0), (math.nan, 0.0), (0.0, 0.0)], reads_rates=True)
    assert ended[1].tolist() == [0, 0]
    assert np.isnan(ended[2]).all()


def recorded(name: str) -> Stream:
    return read_whole_stream(DATA / "flow" / f"{name}.tlog.gz", 30_000_000)


def flow_found(name: str, firmware: Firmware | None, **params: float) -> dict[str, Finding]:
    """Return what is found about flow in a recording of 4.7.0, judged as that or as another release."""
    found = found_in(gather(recorded(name), firmware=firmware, params=params))
    return {code: one for code, one in found.items() if code.startswith("XNF")}


def test_flow_is_judged_as_the_release_reads_it() -> None:
    later = flow_found("rates_beside_units", None)
    assert set(later) == {"XNF-14", "XNF-16"}
    assert "such as 4.6, would take 3.98 times as much" in later["XNF-16"].evidence
    earlier = flow_found("rates_beside_units", STABLE_4_6)
    assert set(earlier) == {"XNF-05", "XNF-09", "XNF-14"}
    assert {earlier[code].severity for code in ("XNF-05", "XNF-09")} == {Severity.ERROR}
    assert earlier["XNF-05"].fix.startswith("4.6 takes flow_x times the time between messages (0.04 s) times (1 + FLOW")
    assert "Scalers are no cure" in earlier["XNF-05"].fix


@pytest.mark.parametrize("name", [firmware.name for firmware in PROFILES.values()])
def test_scale_of_each_release_is_named_by_its_formula(name: str) -> None:
    firmware = PROFILES[name]
    fix = flow_found("rates_beside_units", firmware, FLOW_FXSCALER=-700, FLOW_FYSCALER=-700)["XNF-05"].fix
    if firmware.reads_flow_rates:
        assert fix == (
            f"{name} takes flow_rate_x times (1 + FLOW_FXSCALER / 1000) as rad/s, whatever flow_x is: send flow_rate_x "
            "and flow_rate_y in rad/s, with both scalers 0, or set FLOW_FXSCALER 0 and FLOW_FYSCALER 0."
        )
    else:
        assert fix.startswith(f"{name} takes flow_x times the time between messages (0.04 s)")
        assert "or set" not in fix


def test_flow_x_that_is_right_where_it_counts_is_no_error(sound: Evidence) -> None:
    """Rates that another release would take are a note."""
    (flow,) = sound.vehicle.ground.flows
    sent = replace(flow, sent_rate=10 * flow.rate)
    ground = replace(sound.vehicle.ground, flows=(sent,))
    (fit,) = sound.flow_fits
    found = found_in(changed(sound, ground=ground, flow_fits=(replace(fit, flow=sent),)))
    assert list(found) == ["XNF-16"]
    assert "such as 4.7, would take 10 times as much" in found["XNF-16"].evidence


def test_scalers_that_mend_flow_x_alone_are_warned_of() -> None:
    found = flow_found("rates_beside_units", STABLE_4_6, FLOW_FXSCALER=-750, FLOW_FYSCALER=-750)
    assert set(found) == {"XNF-14", "XNF-16"}
    assert "such as 4.7, would take 0.251 times as much" in found["XNF-16"].evidence


@pytest.mark.parametrize("firmware", PROFILES.values(), ids=lambda one: one.name)
def test_flow_that_is_sent_as_the_fix_says_suits_every_release(firmware: Firmware) -> None:
    def both(_time_us: int, flow: OPTICAL_FLOW) -> OPTICAL_FLOW:
        turned = replace(flow, flow_x=flow.flow_y, flow_y=-flow.flow_x)
        return replace(turned, flow_rate_x=turned.flow_x * FLOW_S, flow_rate_y=turned.flow_y * FLOW_S)

    assert findings_of(evidence_of(with_flow(flight({"FLOW_ORIENT_YAW": 9000}), both), firmware)) == []


def test_steps_of_flow_are_left_behind_by_rates_where_these_are_read(frames: list[Timed]) -> None:
    slow = with_fault(frames, f"kind: rate, {FLOW}, rate_hz: 10")
    fixes = {name: found_in(evidence_of(slow, one))["XNF-09"].fix for name, one in PROFILES.items()}
    assert {name for name, fix in fixes.items() if fix.startswith("Send flow_rate_x")} == {"2026-02", "4.7", "2026-04"}
    assert all(fix.startswith("Send flow_x") for name, fix in fixes.items() if not PROFILES[name].reads_flow_rates)


def with_flow(frames: list[Timed], change: Callable[[int, OPTICAL_FLOW], OPTICAL_FLOW]) -> list[Timed]:
    """Return frames with each OPTICAL_FLOW changed, by its time in us."""
    codec, found = Codec(1, 197), []
    for time_us, frame in frames:
        codec.feed(frame)
        received = codec.next_received()
        message = received.message if isinstance(received, Received) else None
        if isinstance(message, OPTICAL_FLOW):
            frame = codec.encode(change(time_us, message))
        found.append((time_us, frame))
    return found


def test_scalers_are_of_the_axes_of_the_sensor() -> None:
    """A sensor that is turned by 90 degrees, and whose x axis, the body's y, is twice too large."""

    def turned(_time_us: int, flow: OPTICAL_FLOW) -> OPTICAL_FLOW:
        return replace(flow, flow_x=2 * flow.flow_y, flow_y=-flow.flow_x)

    fix = found_in(evidence_of(with_flow(flight({"FLOW_ORIENT_YAW": 9000}), turned)))["XNF-05"].fix
    assert re.search("set FLOW_FXSCALER -(49|50)[0-9] and FLOW_FYSCALER -?[0-9] ", fix.replace(".", " "))


def test_flow_that_no_release_reads_is_named() -> None:
    found = flow_found("optical_flow_rad", None)
    assert set(found) == {"XNF-12", "XNF-15"}
    assert "OPTICAL_FLOW_RAD from 1/197: 176 messages, all ignored; no other flow was heard" in found["XNF-15"].evidence
    assert found["XNF-15"].severity is Severity.ERROR
    assert "Send OPTICAL_FLOW instead" in found["XNF-15"].fix
    other = flow_found("optical_flow_rad", None, FLOW_TYPE=6)
    assert other["XNF-15"].severity is Severity.NOTE


def test_flow_that_no_release_reads_is_named_on_a_link() -> None:
    ours, theirs = make_pair(("ours", "theirs"))
    sent = [message.frame for message in recorded("optical_flow_rad").messages if message.frame[7:10] == b"\x6a\0\0"]

    def send_next(_passed_s: float) -> None:
        theirs.send(sent.pop(0))

    stream = heard_on_link(ours, 30_000_000, 9.0, lambda: -float(len(sent)), lambda: len(sent) < 100, send_next)
    found = {finding.code: finding for finding in diagnose(gather(stream), CHECKS)}
    assert set(found) == {"XNF-15"}
    assert "from 1/197" in found["XNF-15"].evidence


def stabilised(firmware: Firmware, options: int) -> Evidence:
    """Return a flight whose sensor hangs level, so that its flow shows the velocity over the ground alone."""

    def level(time_us: int, flow: OPTICAL_FLOW) -> OPTICAL_FLOW:
        state = state_at(1e-6 * (time_us - START_US))
        x, y = -state.right / state.height_m, state.ahead / state.height_m
        return replace(flow, flow_x=round(x / FLOW_S), flow_y=round(y / FLOW_S), flow_rate_x=x, flow_rate_y=y)

    by_gps = {"EK3_SRC1_POSXY": 3, "EK3_SRC1_VELXY": 3, "FLOW_OPTIONS": options}
    return evidence_of(with_flow(flight(by_gps), level), firmware)


def test_stabilised_sensor_shows_the_velocity_alone() -> None:
    (fit,) = stabilised(STABLE_4_7, 1).flow_fits
    assert (fit.by_turning, fit.is_judged) == (False, True)
    assert fit.factors == pytest.approx((1, 1), abs=0.05)
    assert set(found_in(stabilised(STABLE_4_7, 1))) == {"XNF-02", "XNF-14"}


@pytest.mark.parametrize(
    ("firmware", "options", "fix"), [(STABLE_4_7, 0, ", set FLOW_OPTIONS 1;"), (JULY_2025, 1, ", fix it to the frame")]
)
def test_stabilised_sensor_that_counts_as_fixed_is_named(firmware: Firmware, options: int, fix: str) -> None:
    finding = found_in(stabilised(firmware, options))["XNF-05"]
    assert "about x is 0.00 times, about y 0.00" in finding.evidence
    assert fix in finding.fix


def test_poses_tell_where_no_vehicle_does() -> None:
    of_companion = [(time_us, frame) for time_us, frame in flight(without=()) if read_packet(frame).component_id != 1]
    evidence = evidence_of(with_fault(of_companion, RBD))
    assert found_in(evidence)["XNF-06"].evidence.endswith(
        "turned by 90 degrees (clockwise from above), as the turning of the stream's poses shows in 513 measurements"
    )
    late = with_fault(of_companion, f"kind: delay, {RANGE}, delay_ms: 300")
    assert "XNR-10" in found_in(evidence_of(late))
    assert findings_of(evidence_of(of_companion)) == []


def test_companion_that_sends_flow_alone_lacks_no_poses(frames: list[Timed]) -> None:
    alone = evidence_of([(time_us, frame) for time_us, frame in frames if read_packet(frame).component_id != 1])
    assert {finding.code for finding in diagnose(alone, CHECKS)} == {"XNF-14", "XNR-09"}


def test_flow_is_no_source_of_a_position() -> None:
    found = diagnose(evidence_of(flight({"EK3_SRC1_POSXY": 5}, without=("VISION_POSITION_ESTIMATE",))), CHECKS)
    (illegal,) = [finding for finding in found if finding.code == "XN7-07"]
    assert illegal.evidence.startswith("EK3_SRC1_POSXY is 5; there are 0, 3, 4, 6")
    assert illegal.fix == "Set it to 0: flow tells no position."


def turning_seen(sound: Evidence) -> Floats:
    """Return the vehicle's turning about x and y when its flow sensor said something."""
    turning, time_us = sound.vehicle.ground.turning, sound.vehicle.ground.flows[0].time_us
    return np.column_stack([np.interp(time_us, turning[:, 0], axis) for axis in turning[:, 1:3].T])


def test_telemetry_of_the_autopilot_is_slower_than_its_sensors(sound: Evidence) -> None:
    """OPTICAL_FLOW and DISTANCE_SENSOR that the autopilot itself sends, twice a second."""
    codec = Codec(1, 1)
    frames = flight(without=("OPTICAL_FLOW", "DISTANCE_SENSOR", "VISION_POSITION_ESTIMATE"))
    (flow,), (down,), body = sound.vehicle.ground.flows, sound.vehicle.ground.ranges, turning_seen(sound)
    for number in range(0, len(flow), 10):
        (x, y), (own_x, own_y) = flow.rate[number].tolist(), body[number].tolist()
        told = OPTICAL_FLOW(0, 0, 0, 0, x - own_x, y - own_y, 180, 1.0, x, y)
        frames.append((int(flow.time_us[number]), codec.encode(told)))
    for number in range(0, len(down), 5):
        range_told = DISTANCE_SENSOR(0, 5, 3000, round(100 * down.dist_m[number]), 0, 0, 25, 0)
        frames.append((int(down.time_us[number]), codec.encode(range_told)))
    evidence = evidence_of(sorted(frames, key=lambda frame: frame[0]))
    assert [finding.code for finding in findings_of(evidence)] == ["XNF-14"]
    assert evidence.vehicle.ground.flows[0].body == pytest.approx(body[::10], abs=1e-6)


def of_log(sound: Evidence, body_factor: float = 1.0, check: Floats | None = None) -> Evidence:
    """Return the flight as a log has it, whose sensor has a gyro."""
    own = sound.vehicle.own_filter
    assert own is not None
    (said,) = sound.vehicle.ground.flows
    body = body_factor * turning_seen(sound)
    flow = FlowSeries("OF", said.time_us, said.rate, body, said.quality, np.zeros(0, np.int64))
    ground = replace(sound.vehicle.ground, flows=(flow,), check=sound.vehicle.ground.check if check is None else check)
    fits = fit_flow(ground, sound.vehicle.attitude, sound.vehicle.height, sound.vehicle.position, uses_flow=True)
    return changed(sound, ground=ground, flow_fits=fits, own_filter=replace(own, witness=Witness.LOG))


@pytest.mark.parametrize(
    ("factor", "said"), [(-1.0, "turned by 180 degrees"), (1.4, "1.40 times"), (0.0, "always the same")]
)
def test_gyro_of_the_sensor_that_disagrees_is_named(sound: Evidence, factor: float, said: str) -> None:
    assert said in found_in(of_log(sound, factor))["XNF-08"].evidence
    assert findings_of(of_log(sound)) == []


def test_noise_takes_nothing_from_the_scale(sound: Evidence) -> None:
    (flow,) = sound.vehicle.ground.flows
    noisy = replace(flow, rate=flow.rate + np.random.default_rng(1).normal(0.0, 0.15, flow.rate.shape))
    ground = replace(sound.vehicle.ground, flows=(noisy,))
    (fit,) = fit_flow(ground, sound.vehicle.attitude, sound.vehicle.height, sound.vehicle.position, uses_flow=True)
    assert fit.is_judged
    assert min(fit.explained) < 0.9
    assert fit.factors == pytest.approx((1, 1), abs=0.05)


def test_flow_that_the_vehicle_itself_rejected_is_named(sound: Evidence) -> None:
    time_us = sound.vehicle.ground.turning[::5, 0]
    check = np.column_stack([time_us, np.where(np.arange(len(time_us)) % 2, 2.5, 0.1), np.full(len(time_us), 3.0)])
    finding = found_in(of_log(sound, check=check))["XNF-13"]
    assert "(50 %) records in flight" in finding.evidence
    assert finding.severity is Severity.ERROR


def test_what_a_log_does_not_hold_is_no_fault(sound: Evidence) -> None:
    nothing = changed(of_log(sound), ground=GroundSensors(), flow_fits=())
    asking = changed(nothing, params={**nothing.trial.params, "EK3_SRC1_POSZ": 2.0})
    assert {code: one.severity for code, one in found_in(asking).items()} == {
        "XNF-14": Severity.NOTE,
        "XNR-09": Severity.NOTE,
    }
    logged = changed(asking, known={**asking.set_up.known, "LOG_BITMASK": 65535.0})
    assert {"XNF-01", "XNF-12", "XNR-01"} == set(found_in(logged))


def test_log_of_replay_records_alone_has_ranges() -> None:
    path = RECORDED / "logs" / "flow_take_off.BIN.xz"
    evidence = gather(read_whole_stream(path, 0), vehicle=vehicle_of_log(path), is_tried=False)
    assert [(one.origin, one.looks_down, bool(one.is_good.any())) for one in evidence.vehicle.ground.ranges] == [
        ("RRNI", True, True)
    ]
    assert {finding.code for finding in findings_of(evidence)} == {"XNF-14"}


@pytest.mark.slow
@pytest.mark.skipif(not LOGS.is_dir(), reason="needs the firmware's flights with flow, beside the project")
@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("flow_guided", {}),
        ("extpos_mavflow", {}),
        ("gps_flow_terrain", {"XNF-14": "no range was good"}),
        ("flow_dropout", {"XNF-04": "2 times; the longest gap of 9.1 s from 59.300 s on"}),
        ("rng_height", {"XNR-05": "time of 6.5 s from 58.549 s on (130 of 130 (100 %) without data)"}),
        ("flow_ground", {"XNF-12": "RFND", "XNR-04": "RNGFND1_MIN 0.20", "XNF-14": "hardly moved", "XNR-09": "climb"}),
    ],
)
def test_flights_of_the_firmware(name: str, told: Mapping[str, str]) -> None:
    path = LOGS / f"{name}.BIN.xz"
    found = found_in(gather(read_whole_stream(path, 0), vehicle=vehicle_of_log(path), is_tried=False))
    assert set(found) == set(told)
    assert all(said in found[code].evidence for code, said in told.items())
