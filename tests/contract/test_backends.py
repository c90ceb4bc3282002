# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every backend of AP_VisualOdom keeps to, whichever VISO_TYPE chose it."""

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import VerdictKind
from ap_visualodom.ap_visualodom import BACKENDS
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from ap_visualodom.var_info import VisualOdom_Type
from ap_visualodom.verdicts import CONSUMED, QUALITY_BELOW_MIN, VERDICTS

if TYPE_CHECKING:
    from tests.conftest import MakeRig, Rig

FLOATS = st.floats(width=32)
VECTORS = st.builds(Vector3f, FLOATS, FLOATS, FLOATS)
QUATERNIONS = st.builds(Quaternion, FLOATS, FLOATS, FLOATS, FLOATS)
COUNTERS = st.integers(0, 255)
QUALITIES = st.integers(-128, 127)
STRUCTURES = {structure.name: structure for structure in LOG_STRUCTURE_FROM_VISUALODOM}

fresh_for_each_example = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(params=BACKENDS, ids=lambda kind: kind.name)
def kind(request: pytest.FixtureRequest) -> VisualOdom_Type:
    assert isinstance(request.param, VisualOdom_Type)
    return request.param


@pytest.fixture
def rig(make_rig: "MakeRig", kind: VisualOdom_Type) -> "Rig":
    return make_rig(TYPE=kind)


class TestBackend:
    """The contract."""

    @pytest.mark.parametrize(("time_ms", "healthy"), [(0, True), (299, True), (300, False)])
    def test_healthy_in_the_first_300_ms_after_boot(self, rig: "Rig", time_ms: int, healthy: bool) -> None:
        rig.at_ms(time_ms)
        assert rig.visual_odom.healthy() is healthy

    @pytest.mark.parametrize("sample", ["pose", "speed", "delta"])
    @pytest.mark.parametrize("sent_ms", [10_000, (1 << 32) - 100])
    @pytest.mark.parametrize(("age_ms", "healthy"), [(299, True), (300, False)])
    def test_healthy_for_300_ms_after_any_sample(
        self, rig: "Rig", sample: str, sent_ms: int, age_ms: int, healthy: bool
    ) -> None:
        rig.at_ms(sent_ms)
        getattr(rig, sample)()
        rig.at_ms(sent_ms + age_ms)
        assert rig.visual_odom.healthy() is healthy

    def test_pose_makes_one_call_and_one_record(self, rig: "Rig") -> None:
        rig.pose()
        assert len(rig.ahrs.calls) == len(rig.extnav) == 1
        assert [name for name, _ in rig.records] == ["VISP"]

    def test_speed_makes_one_call_and_one_record(self, rig: "Rig") -> None:
        rig.speed()
        assert len(rig.ahrs.calls) == len(rig.extvel) == 1
        assert [name for name, _ in rig.records] == ["VISV"]

    def test_delta_makes_one_call_and_one_record(self, rig: "Rig") -> None:
        rig.delta()
        assert len(rig.ahrs.calls) == len(rig.odom) == 1
        assert [name for name, _ in rig.records] == ["VISO"]

    def test_withheld_sample_makes_a_record_alone(self, rig: "Rig") -> None:
        rig.set(QUAL_MIN=50)
        assert rig.pose(quality=49) is QUALITY_BELOW_MIN
        assert rig.speed(quality=49) is QUALITY_BELOW_MIN
        assert rig.ahrs.calls == []
        assert [(name, fields["Ign"]) for name, fields in rig.records] == [("VISP", 1), ("VISV", 1)]

    @pytest.mark.parametrize("sample", ["pose", "speed"])
    def test_quality_of_the_last_sample_is_reported(self, rig: "Rig", sample: str) -> None:
        getattr(rig, sample)(quality=77)
        assert rig.visual_odom.quality() == 77

    def test_delta_leaves_the_quality(self, rig: "Rig") -> None:
        rig.pose(quality=77)
        rig.delta(confidence=3)
        assert rig.visual_odom.quality() == 77

    def test_delta_passes_whatever_the_quality_gate(self, rig: "Rig") -> None:
        rig.set(QUAL_MIN=100)
        assert rig.delta(confidence=0) is CONSUMED

    def test_velocity_is_never_scaled(self, rig: "Rig") -> None:
        rig.set(SCALE=3)
        rig.speed(Vector3f(1, 2, 3))
        assert rig.extvel[0].vel == Vector3f(1, 2, 3)

    @pytest.mark.parametrize("noise", [-1, 0, 100])
    def test_velocity_noise_is_the_parameter_as_it_is(self, rig: "Rig", noise: float) -> None:
        rig.set(VEL_M_NSE=noise)
        rig.speed()
        assert rig.extvel[0].err == f32(noise)

    def test_requests_send_nothing_by_themselves(self, rig: "Rig") -> None:
        rig.align_ready(1.0)
        rig.visual_odom.request_align_yaw_to_ahrs()
        rig.visual_odom.align_position_to_ahrs(True, True)
        assert (rig.ahrs.calls, rig.records, rig.texts) == ([], [], [])

    def test_times_are_passed_through(self, rig: "Rig") -> None:
        rig.pose(remote_us=(1 << 64) - 1, time_ms=(1 << 32) - 1)
        rig.speed(remote_us=(1 << 64) - 1, time_ms=(1 << 32) - 1)
        assert [call.timeStamp_ms for call in rig.ahrs.calls] == [(1 << 32) - 1] * 2
        assert [fields["RTimeUS"] for _, fields in rig.records] == [(1 << 64) - 1] * 2

    def test_arming_check_without_messages_fails_after_boot(self, rig: "Rig") -> None:
        assert rig.visual_odom.pre_arm_check() == "not healthy"

    @fresh_for_each_example
    @given(pos=VECTORS, attitude=QUATERNIONS, pos_err=FLOATS, ang_err=FLOATS, counter=COUNTERS, quality=QUALITIES)
    def test_any_pose_is_judged_by_a_rule_and_logged(
        self,
        make_rig: "MakeRig",
        kind: VisualOdom_Type,
        pos: Vector3f,
        attitude: Quaternion,
        pos_err: float,
        ang_err: float,
        counter: int,
        quality: int,
    ) -> None:
        rig = make_rig(TYPE=kind, ORIENT=25)
        rig.align_ready(1.0)
        verdict = rig.pose(pos, attitude, pos_err=pos_err, ang_err=ang_err, counter=counter, quality=quality)
        assert verdict in VERDICTS
        assert (verdict.kind is VerdictKind.ACCEPTED) == (len(rig.extnav) == 1)
        [fields] = rig.logged("VISP")
        assert fields["Ign"] == (verdict.kind is not VerdictKind.ACCEPTED)
        assert len(STRUCTURES["VISP"].pack(list(fields.values()))) == STRUCTURES["VISP"].length

    @fresh_for_each_example
    @given(pos_err=FLOATS, ang_err=FLOATS)
    def test_errors_handed_over_are_within_their_limits(
        self, make_rig: "MakeRig", kind: VisualOdom_Type, pos_err: float, ang_err: float
    ) -> None:
        rig = make_rig(TYPE=kind)
        rig.pose(pos_err=pos_err, ang_err=ang_err)
        [call] = rig.extnav
        assert f32(0.2) <= call.posErr <= 100
        assert f32(0.2) <= call.angErr <= 1.5

    @fresh_for_each_example
    @given(pos=VECTORS, attitude=QUATERNIONS, vel=VECTORS, confidence=FLOATS)
    def test_everything_handed_over_is_float32(
        self,
        make_rig: "MakeRig",
        kind: VisualOdom_Type,
        pos: Vector3f,
        attitude: Quaternion,
        vel: Vector3f,
        confidence: float,
    ) -> None:
        rig = make_rig(TYPE=kind, ORIENT=38, SCALE=1.1)
        rig.align_ready(1.0)
        rig.pose(pos, attitude)
        rig.speed(vel)
        rig.delta(pos, vel, confidence=confidence)
        logged = [value for _, fields in rig.records for value in fields.values()]
        assert {type(value) for value in logged} == {int, np.float32}

    @fresh_for_each_example
    @given(pos=VECTORS, attitude=QUATERNIONS, counters=st.lists(COUNTERS, max_size=5))
    def test_same_input_gives_same_output(
        self, make_rig: "MakeRig", kind: VisualOdom_Type, pos: Vector3f, attitude: Quaternion, counters: list[int]
    ) -> None:
        runs = []
        for _ in range(2):
            rig = make_rig(TYPE=kind)
            rig.align_ready(1.0)
            verdicts = [rig.pose(pos, attitude, counter=counter) for counter in counters]
            records = [STRUCTURES[name].pack(list(fields.values())) for name, fields in rig.records]
            runs.append((verdicts, records, rig.texts, rig.errors.count))
        assert runs[0] == runs[1]

    @fresh_for_each_example
    @given(angle=st.floats(-math.pi / 2, math.pi / 2))
    def test_attitude_of_a_level_camera_stays_level(
        self, make_rig: "MakeRig", kind: VisualOdom_Type, angle: float
    ) -> None:
        rig = make_rig(TYPE=kind)
        rig.align_ready(1.0)
        rig.pose(attitude=Quaternion.from_euler(f32(0), f32(0), f32(angle)))
        [fields] = rig.logged("VISP")
        assert fields["R"] == pytest.approx(0, abs=1e-4)
        assert fields["P"] == pytest.approx(0, abs=1e-4)
