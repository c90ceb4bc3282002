# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot of a test: its time, its link, what is seen of it, and what may be claimed."""

import math
import re
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from pymavlink.DFReader import DFReader_binary

from ap_core.verdict import VerdictKind
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT, PARAM_VALUE, STATUSTEXT, VISION_POSITION_ESTIMATE
from tests.unit.viso.testing.sample_odometry import odometry
from viso.testing import Autopilot, AutopilotOptions
from viso.testing.diagnosis import check_no_findings
from viso.vehicle.outcomes import OutcomeKind


def fly(autopilot: Autopilot, count: int) -> None:
    for number in range(count):
        autopilot.send(odometry(30_000 * number, x=0.03 * number, vx=1.0))
        autopilot.advance(ms=30)


# Time


def test_time_stands_still_unless_told_otherwise(autopilot: Autopilot) -> None:
    autopilot.send(odometry())
    assert autopilot.now_us == 6_500_000
    autopilot.advance(ms=0.5)
    autopilot.advance(s=0.25)
    assert autopilot.now_us == 6_750_500


def test_small_steps_give_what_one_large_step_gives(autopilot: Autopilot) -> None:
    other = Autopilot(AutopilotOptions(params={"VISO_QUAL_MIN": 50}))
    for step_ms in (0.7, 1.1, 3.2, 95):
        autopilot.advance(ms=step_ms)
    other.advance(ms=100)
    assert autopilot.records == other.records
    assert len(autopilot.records) > 0


def test_what_is_no_duration_is_refused(autopilot: Autopilot) -> None:
    wrong: list[dict[str, float]] = [{}, {"ms": 1, "s": 1}, {"ms": -1}, {"s": float("nan")}, {"s": float("inf")}]
    for durations in wrong:
        with pytest.raises(ValueError, match=r"^advance "):
            autopilot.advance(**durations)


# Messages and their outcomes


def test_verdict_tells_all_about_a_message(autopilot: Autopilot) -> None:
    sent = odometry(5, x=1.5)
    (verdict,) = autopilot.send(sent, system_id=1, component_id=191)
    assert (verdict.time_us, verdict.name, verdict.system_id, verdict.component_id) == (6_500_000, "ODOMETRY", 1, 191)
    assert (verdict.kind, verdict.rule, verdict.message) == (VerdictKind.ACCEPTED, "consumed", sent)
    assert verdict.reason == "handed to the EKF"
    assert [record.name for record in verdict.records] == ["VISP", "VISV"]
    assert verdict.records[0]["PX"] == 1.5
    assert autopilot.verdicts == [verdict]


def test_outcomes_come_later(autopilot: Autopilot) -> None:
    fly(autopilot, 4)
    (verdict,) = autopilot.send(odometry(120_000, x=0.12, vx=1.0))
    at_first = verdict.outcomes, verdict.is_settled
    assert at_first == ((), False)
    autopilot.advance(ms=250)
    assert sorted(outcome.kind for outcome in verdict.outcomes) == ["height", "pose", "velocity", "yaw"]
    assert {outcome.outcome for outcome in verdict.outcomes} == {OutcomeKind.FUSED}
    assert verdict.is_settled


def test_message_that_brings_nothing_has_no_outcomes(autopilot: Autopilot) -> None:
    (verdict,) = autopilot.send(odometry(frame_id=1))
    assert (verdict.rule, verdict.outcomes, verdict.is_settled) == ("odometry_frames", (), True)


def test_bytes_give_any_number_of_verdicts(autopilot: Autopilot) -> None:
    codec = Codec(1, 197)
    frames = codec.encode(odometry(1)) + codec.encode(odometry(2))
    assert autopilot.send(frames[:50]) == ()
    assert [verdict.kind for verdict in autopilot.send(frames[50:])] == [VerdictKind.ACCEPTED] * 2
    assert {verdict.name for verdict in autopilot.send(b"no frame")} == {"BAD_DATA"}


def test_nothing_of_the_start_is_seen_but_in_the_log(autopilot: Autopilot, tmp_path: Path) -> None:
    assert (autopilot.status_texts, autopilot.received, autopilot.read()) == ([], [], b"")
    autopilot.send(odometry(x=1.5))
    autopilot.write_log(tmp_path / "test.BIN")
    assert (tmp_path / "test.BIN").read_bytes() == autopilot.log_bytes
    with DFReader_binary(str(tmp_path / "test.BIN")) as log:
        records = list(iter(log.recv_msg, None))
    texts = [record.Message for record in records if record.get_type() == "MSG"]
    assert "ArduPilot Ready" in texts
    assert [record.PX for record in records if record.get_type() == "VISP"] == [1.5]


@pytest.mark.slow
def test_without_a_log_there_is_none_to_write(tmp_path: Path) -> None:
    autopilot = Autopilot(AutopilotOptions(params={"LOG_DISARMED": 0}))
    assert autopilot.log_bytes == b""
    with pytest.raises(ValueError, match="there is no log: LOG_DISARMED is 0"):
        autopilot.write_log(tmp_path / "test.BIN")


def test_what_the_autopilot_sends_is_seen_and_can_be_read(autopilot: Autopilot) -> None:
    autopilot.write(Codec(1, 197).encode(odometry()))
    autopilot.advance(s=1)
    assert len(autopilot.received_of(HEARTBEAT)) == 1
    texts = [text.text for text in autopilot.status_texts]
    assert [message.text for message in autopilot.received_of(STATUSTEXT)] == texts
    codec = Codec(255, 190)
    codec.feed(autopilot.read())
    read = []
    while (received := codec.next_received()) is not None:
        read.append(getattr(received, "message", None))
    assert read == autopilot.received
    assert autopilot.read() == b""


def test_clear_forgets_what_was_seen(autopilot: Autopilot) -> None:
    (verdict,) = autopilot.send(odometry())
    autopilot.advance(s=0.6)
    autopilot.clear()
    seen = autopilot.verdicts, autopilot.records, autopilot.status_texts, autopilot.received
    assert seen == ([], [], [], [])
    assert verdict.is_settled


def test_lists_that_were_asked_for_stay_as_they_are(autopilot: Autopilot) -> None:
    before = autopilot.verdicts
    autopilot.send(odometry())
    assert before == []


# Parameters


def test_parameters_are_set_as_by_a_ground_station(autopilot: Autopilot) -> None:
    autopilot.send(HEARTBEAT(18, 8, 0, 0, 4, 3))
    autopilot.params["VISO_QUAL_MIN"] = 95
    (verdict,) = autopilot.send(odometry())
    autopilot.advance(ms=10)
    assert verdict.rule == "quality_below_min"
    assert autopilot.params["VISO_QUAL_MIN"] == 95
    (echo,) = autopilot.received_of(PARAM_VALUE)
    assert (echo.param_id, echo.param_value) == ("VISO_QUAL_MIN", 95)


def test_parameters_are_a_mapping(autopilot: Autopilot) -> None:
    names = list(autopilot.params)
    assert len(names) == len(set(names)) == len(autopilot.params) > 100
    assert {"VISO_TYPE", "EK3_SRC1_POSXY"} <= set(names)
    assert "VISO_TYP" not in autopilot.params


def test_parameters_that_there_are_not_are_refused(autopilot: Autopilot) -> None:
    with pytest.raises(KeyError, match="VISO_TYP: no such parameter"):
        autopilot.params["VISO_TYP"]
    with pytest.raises(KeyError, match="VISO_TYP: no such parameter"):
        autopilot.params["VISO_TYP"] = 1
    with pytest.raises(ValueError, match="VISO_SCALE: nan is not finite"):
        autopilot.params["VISO_SCALE"] = float("nan")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("firmware", "params", "read"),
    [
        ("4.6", {"SYSID_THISMAV": 7, "ARMING_CHECK": 0}, {"SYSID_THISMAV": 7, "ARMING_CHECK": 0}),
        ("2025-07", {"SYSID_THISMAV": 7, "ARMING_CHECK": 0}, {"MAV_SYSID": 7, "ARMING_CHECK": 0}),
        ("2026-02", {"SYSID_THISMAV": 7, "ARMING_CHECK": 0}, {"MAV_SYSID": 7, "ARMING_SKIPCHK": -1}),
        ("2026-02", {"MAV_SYSID": 7, "ARMING_SKIPCHK": 2}, {"MAV_SYSID": 7, "ARMING_SKIPCHK": 2}),
        ("4.6", {"MAV_SYSID": 7, "ARMING_SKIPCHK": -1}, {"SYSID_THISMAV": 7, "ARMING_CHECK": 0}),
    ],
)
def test_parameters_have_the_names_of_the_firmware_or_of_another_one(
    firmware: str, params: dict[str, float], read: dict[str, float]
) -> None:
    autopilot = Autopilot(AutopilotOptions(params=params, firmware=firmware))
    assert {name: autopilot.params[name] for name in read} == read
    autopilot.close()


def test_name_of_another_firmware_is_told_the_one_here(autopilot: Autopilot) -> None:
    with pytest.raises(KeyError, match="SYSID_THISMAV: no such parameter; this firmware calls it MAV_SYSID"):
        autopilot.params["SYSID_THISMAV"]


# Claims


def test_good_flight_holds_all_claims(autopilot: Autopilot) -> None:
    assert autopilot.aiding == "none"
    fly(autopilot, 20)
    autopilot.assert_accepted()
    autopilot.assert_accepted(count=20, message="ODOMETRY")
    autopilot.assert_fused()
    autopilot.assert_fused("yaw")
    autopilot.assert_healthy()
    autopilot.assert_text("is using external nav data")
    assert autopilot.aiding == "absolute"
    for claim in (autopilot.assert_dropped, autopilot.assert_ignored):
        with pytest.raises(AssertionError):
            claim()


def test_number_of_fused_samples_is_exact(autopilot: Autopilot) -> None:
    fly(autopilot, 20)
    autopilot.advance(ms=300)
    fused = sum(
        outcome[:2] == ("velocity", OutcomeKind.FUSED) for verdict in autopilot.verdicts for outcome in verdict.outcomes
    )
    assert fused > 15
    autopilot.assert_fused("velocity", count=fused)
    with pytest.raises(AssertionError, match=rf"^expected {fused + 1} velocity fused, found {fused}; the outcome of"):
        autopilot.assert_fused("velocity", count=fused + 1)


def test_too_early_a_claim_of_fusion_says_so(autopilot: Autopilot) -> None:
    autopilot.send(odometry())
    with pytest.raises(AssertionError, match=r"1 waiting for the filter's decision.*: advance the time"):
        autopilot.assert_fused()


def test_rejected_jump_is_told(autopilot: Autopilot) -> None:
    fly(autopilot, 20)
    autopilot.clear()
    autopilot.send(odometry(600_000, x=500.0))
    autopilot.advance(ms=300)
    with pytest.raises(
        AssertionError, match="1 pose rejected, model_gate_position: rejected: horizontal position gate"
    ):
        autopilot.assert_fused("pose")


def test_claim_of_fusion_without_samples_tells_what_came(autopilot: Autopilot) -> None:
    autopilot.send(odometry(frame_id=1))
    with pytest.raises(AssertionError, match=r"found 0; what came:\n *1 ODOMETRY dropped, odometry_frames"):
        autopilot.assert_fused()


def test_refused_messages_are_counted_by_rule(autopilot: Autopilot) -> None:
    autopilot.send(odometry(frame_id=1))
    autopilot.send(odometry(quality=10))
    autopilot.assert_dropped("odometry_frames", 1)
    autopilot.assert_ignored("quality_below_min", 1, "ODOMETRY")
    autopilot.assert_accepted(count=0)


def test_silence_is_not_healthy(autopilot: Autopilot) -> None:
    with pytest.raises(AssertionError, match="expected a healthy vehicle, but VisOdom: not healthy; nothing has come"):
        autopilot.assert_healthy()


@pytest.mark.slow
def test_vehicle_without_external_navigation_is_not_healthy() -> None:
    autopilot = Autopilot(AutopilotOptions(params={"VISO_TYPE": 0}))
    autopilot.send(odometry())
    with pytest.raises(AssertionError, match=r"VisOdom: VISO_TYPE is 0, and AHRS: .*what came:\n.*viso_disabled"):
        autopilot.assert_healthy()


def test_golden_log_needs_a_folder(autopilot: Autopilot) -> None:
    with pytest.raises(ValueError, match="'flight': this autopilot was made without a folder of golden logs"):
        autopilot.assert_golden("flight")


# What the doctor finds


def climb(autopilot: Autopilot, up: float) -> None:
    """Rest for a moment, then climb by 1 m, in a world whose z points up (1) or down (-1)."""
    for number in range(60):
        height_m = 0.03 * max(0, number - 20)
        autopilot.send(odometry(40_000 * number, z=up * height_m, vz=up * 0.75 * (number > 20)))
        autopilot.advance(ms=40)


@pytest.mark.slow
def test_stream_in_order_has_no_findings(autopilot: Autopilot) -> None:
    climb(autopilot, up=-1.0)
    autopilot.assert_fused()
    autopilot.assert_no_findings()


@pytest.mark.slow
def test_stream_with_z_up_has_a_finding_though_it_is_fused(autopilot: Autopilot) -> None:
    climb(autopilot, up=1.0)
    autopilot.assert_fused()
    with pytest.raises(
        AssertionError, match=r"(?s)but 1:\nwarning XN2-11 .*z grows by up to 1\.2 m.*\n  fix: From ROS"
    ):
        autopilot.assert_no_findings()
    autopilot.assert_no_findings(but=["XN2-11"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "codes"), [("NED", set()), ("ENU", {"XN2-02", "XN2-08"}), ("ENU, z down, level", {"XN2-09"})]
)
def test_stream_of_a_vehicle_that_flies_is_held_against_its_path(name: str, codes: set[str]) -> None:
    params = {"COMPASS_ENABLE": 1, "EK3_SRC1_YAW": 1, "EK3_SRC1_VELXY": 0, "EK3_SRC1_VELZ": 0}
    autopilot = Autopilot(AutopilotOptions(imu="fly", params=params))

    def look() -> None:
        assert autopilot.vehicle.source.airframe is not None
        north, east, down = autopilot.truth.pos_ned
        roll, pitch, yaw = autopilot.vehicle.source.airframe.state.rpy
        seen = {
            "NED": (north, east, down, roll, pitch, yaw),
            "ENU": (east, north, -down, roll, -pitch, math.pi / 2 - yaw),
            "ENU, z down, level": (east, north, down, 0.0, 0.0, math.pi / 2 - yaw),
        }
        autopilot.send(VISION_POSITION_ESTIMATE(autopilot.now_us, *seen[name]))

    autopilot.every(33, look)
    with nullcontext() if name == "NED" else pytest.raises(AssertionError):
        autopilot.takeoff(2)
        autopilot.goto(4, 2, 2, within_s=12)
    if not codes:
        autopilot.assert_no_findings()
        return
    with pytest.raises(AssertionError) as findings:
        autopilot.assert_no_findings(least="error")
    assert codes <= set(re.findall(r"XN\d-\d\d", str(findings.value)))


@pytest.mark.parametrize("wrong", [{"least": "fatal"}, {"but": ["XN0-00"]}])
def test_what_is_no_severity_or_code_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"^(least|but)"):
        check_no_findings([], **{"least": "warning", "but": (), **wrong})
