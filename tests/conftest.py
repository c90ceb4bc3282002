# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures for every test: an AP_VisualOdom whose surroundings are settable and remembered."""

import gc
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import threadpoolctl
from hypothesis import settings

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ekf_stub.ahrs.ahrs_settable import BodyFrameOdom, ExtNav, ExtNavVel, SettableAhrs
from ekf_stub.core import IS_COMPILED

# A busy machine is no fault of the code; and where nobody looks on, every run is to be the same.
WHOLE = settings(deadline=None, derandomize=os.environ.get("CI") == "true")
settings.register_profile("whole", WHOLE, max_examples=50)
settings.register_profile("usual", WHOLE, max_examples=10)


def pytest_configure(config: pytest.Config) -> None:
    """Draw fewer examples when slow tests are left out, and save time that nothing is tested in.

    Linear algebra gets one thread: a second one, for matrices as small as these, only waits, and by spinning. The
    garbage collector runs less often: the collection of twelve thousand tests makes nothing that it could free.
    """
    settings.load_profile("usual" if "not slow" in config.option.markexpr else "whole")
    threadpoolctl.threadpool_limits(limits=1, user_api="blas")
    gc.set_threshold(100_000, 50, 100)


def pytest_report_header() -> str:
    """Say what the tests of the filter are about: a source that was edited since it was compiled runs interpreted."""
    return f"filter: {'compiled' if IS_COMPILED else 'interpreted'}"


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files whose tests are all left out: what they import takes seconds, in every process."""
    left_out = "|".join(re.findall(r"not (\w+)", config.option.markexpr))
    if not left_out or collection_path.suffix != ".py":
        return None
    text = collection_path.read_text(encoding="utf-8")
    return re.search(rf"^pytestmark = \[?pytest\.mark\.({left_out})\b", text, re.MULTILINE) is not None or None


def pytest_collection_finish() -> None:
    """Keep the garbage collector from what is there before the first test: it is large, and stays to the end."""
    gc.freeze()


Record = tuple[str, dict[str, LogValue]]

LEVEL = Quaternion()


class Rig:
    """A vehicle's AP_VisualOdom, initialised, ten seconds after boot, with an AHRS that knows nothing yet.

    Parameters go by their names without ``VISO_``; samples have harmless defaults.
    """

    def __init__(self, params: dict[str, float | Vector3f]) -> None:
        self.clock = VirtualClock(10_000_000)
        self.ahrs = SettableAhrs()
        self.errors = InternalErrors()
        self.texts: list[tuple[int, str]] = []
        self.records: list[Record] = []
        self.params = make_params()
        self.set(**params)
        self.visual_odom = AP_VisualOdom(
            self.params, ahrs=self.ahrs, gcs=self, logger=self, clock=self.clock, errors=self.errors
        )
        self.visual_odom.init()

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        self.texts.append((severity, text))

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Remember a record by its labels (RecordSink)."""
        self.records.append((structure.name, dict(zip(structure.fields, values, strict=True))))

    def set(self, **params: float | Vector3f) -> None:
        """Set parameters, at any time."""
        for name, value in params.items():
            self.params.set(f"_{name}", value)

    def at_ms(self, time_ms: int) -> None:
        """Set the time since boot, which may be beyond the 32-bit wrap."""
        self.clock.set_us(time_ms * 1000)

    def align_ready(self, yaw_rad: float) -> None:
        """Give the AHRS a yaw of its own, so that yaw alignment is possible."""
        self.ahrs.is_initialised = self.ahrs.is_dcm_yaw_initialised = True
        self.ahrs.is_using_extnav_for_yaw = False
        self.ahrs.yaw = f32(yaw_rad)

    def pose(
        self,
        pos: Vector3f | None = None,
        attitude: Quaternion = LEVEL,
        *,
        remote_us: int = 123_456,
        time_ms: int = 9_990,
        pos_err: float = 0.5,
        ang_err: float = 0.5,
        counter: int = 0,
        quality: int = 50,
    ) -> Verdict:
        """Hand in a position (m) and an attitude."""
        pos = pos if pos is not None else Vector3f()
        errors = f32(pos_err), f32(ang_err)
        return self.visual_odom.handle_pose_estimate(remote_us, time_ms, pos, attitude, *errors, counter, quality)

    def speed(
        self,
        vel: Vector3f | None = None,
        *,
        remote_us: int = 123_456,
        time_ms: int = 9_990,
        counter: int = 0,
        quality: int = 50,
    ) -> Verdict:
        """Hand in a velocity (m/s)."""
        vel = vel if vel is not None else Vector3f()
        return self.visual_odom.handle_vision_speed_estimate(remote_us, time_ms, vel, counter, quality)

    def delta(
        self,
        angle: Vector3f | None = None,
        position: Vector3f | None = None,
        *,
        delta_us: int = 20_000,
        confidence: float = 70.0,
    ) -> Verdict:
        """Hand in a change of angle (rad) and position (m)."""
        angle = angle if angle is not None else Vector3f()
        position = position if position is not None else Vector3f()
        return self.visual_odom.handle_vision_position_delta_msg(delta_us, angle, position, f32(confidence))

    @property
    def extnav(self) -> list[ExtNav]:
        """What writeExtNavData was given."""
        return [call for call in self.ahrs.calls if isinstance(call, ExtNav)]

    @property
    def extvel(self) -> list[ExtNavVel]:
        """What writeExtNavVelData was given."""
        return [call for call in self.ahrs.calls if isinstance(call, ExtNavVel)]

    @property
    def odom(self) -> list[BodyFrameOdom]:
        """What writeBodyFrameOdom was given."""
        return [call for call in self.ahrs.calls if isinstance(call, BodyFrameOdom)]

    def logged(self, name: str) -> list[dict[str, LogValue]]:
        """Return the records of one type by their labels."""
        return [fields for record, fields in self.records if record == name]


MakeRig = Callable[..., Rig]


@pytest.fixture
def make_rig() -> MakeRig:
    """Return a function that makes a Rig from VISO_ parameters given by keyword."""

    def make(**params: float | Vector3f) -> Rig:
        return Rig(params)

    return make


@pytest.fixture
def yawed() -> Callable[[float], Quaternion]:
    """Return a function that makes a level attitude of a yaw in radians."""
    return lambda yaw_rad: Quaternion.from_euler(f32(0), f32(0), np.float32(yaw_rad))
