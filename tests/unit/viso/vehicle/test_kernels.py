# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which arithmetic the filter runs on, and who says so."""

import logging
import sys

import pytest

from ekf_stub.compiled.compiled_state import CompiledErrorState
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.kernel import PLAIN
from viso.errors import InputError
from viso.running.virtual_time import Scheduler
from viso.vehicle.kernels import KERNEL_VARIABLE, KERNELS, chosen_kernel, kernel_of
from viso.vehicle.vehicle import Vehicle, VehicleConfig

RUNNING_US = 5_000_000


def kind_of_state_in_a_vehicle() -> type:
    vehicle = Vehicle(VehicleConfig())
    Scheduler(vehicle).run_until(RUNNING_US)
    return type(vehicle.ahrs.core.state)  # type: ignore[attr-defined]  # the vehicle on the bench has a filter


def test_plain_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(KERNEL_VARIABLE, raising=False)
    assert chosen_kernel() == "plain"
    assert kind_of_state_in_a_vehicle() is ErrorState


def test_environment_chooses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KERNEL_VARIABLE, "numba")
    assert kind_of_state_in_a_vehicle() is CompiledErrorState


def test_unknown_kernel_is_refused_and_the_known_ones_named() -> None:
    with pytest.raises(InputError) as error:
        kernel_of("fast")
    assert all(name in str(error.value) for name in ("fast", KERNEL_VARIABLE, *KERNELS))


def test_without_the_extra_it_goes_on_plain_and_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, "ekf_stub.compiled.compiled_pass", None)  # as if it could not be imported
    with caplog.at_level(logging.WARNING):
        assert kernel_of("numba") is PLAIN
    assert "pip install 'ardupilot-viso[numba]'" in caplog.text
    assert len(caplog.records) == 1
