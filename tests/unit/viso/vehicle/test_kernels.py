# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which arithmetic the filter runs on, and who says so."""

import itertools
import logging
import sys
import threading
from collections.abc import Callable

import pytest

from ekf_stub.compiled import warm_up
from ekf_stub.compiled.compiled_pass import COMPILED
from ekf_stub.compiled.compiled_state import CompiledErrorState
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial_pass import PLAIN
from viso.errors import InputError
from viso.running.virtual_time import Scheduler
from viso.vehicle import kernels
from viso.vehicle.kernels import KERNEL_VARIABLE, KERNELS, chosen_kernel, kernel_of, loading_beside
from viso.vehicle.vehicle import Vehicle, VehicleConfig

RUNNING_US = 5_000_000


def kind_of_state_in_a_vehicle() -> type:
    vehicle = Vehicle(VehicleConfig())
    Scheduler(vehicle).run_until(RUNNING_US)
    return type(vehicle.ahrs.core.state)  # type: ignore[attr-defined]  # the vehicle on the bench has a filter


@pytest.mark.parametrize(("installed", "name"), [(None, "plain"), (object(), "numba")])
def test_compiled_one_is_used_where_numba_is_installed(
    installed: object, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(KERNEL_VARIABLE, raising=False)
    monkeypatch.setattr(kernels, "find_spec", {"numba": installed}.__getitem__)
    assert chosen_kernel() == name


@pytest.mark.parametrize(("name", "kind"), [("plain", ErrorState), ("numba", CompiledErrorState)])
def test_environment_chooses(name: str, kind: type, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KERNEL_VARIABLE, name)
    assert kind_of_state_in_a_vehicle() is kind


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


def test_kernel_is_there_once_it_is_loaded_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KERNEL_VARIABLE, "numba")
    with loading_beside():
        assert kernel_of("numba") is COMPILED


def test_filter_that_begins_while_it_is_compiled_runs_plain(monkeypatch: pytest.MonkeyPatch) -> None:
    is_compiled = threading.Event()

    def compile_slowly(on_compiled: Callable[[int, int], None]) -> None:
        on_compiled(1, 2)
        is_compiled.wait()

    monkeypatch.setattr(warm_up, "warm_up", compile_slowly)
    monkeypatch.setenv(KERNEL_VARIABLE, "numba")
    with loading_beside():
        assert kernel_of("numba") is PLAIN
        is_compiled.set()


def test_what_nobody_needs_is_not_compiled_any_further(monkeypatch: pytest.MonkeyPatch) -> None:
    def compile_without_end(on_compiled: Callable[[int, int], None]) -> None:
        for number in itertools.count():
            on_compiled(number, 2)

    monkeypatch.setattr(warm_up, "warm_up", compile_without_end)
    monkeypatch.setenv(KERNEL_VARIABLE, "numba")
    with loading_beside():
        pass


def test_who_waits_for_the_compiler_is_told_how_long_it_takes(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(warm_up, "_compiled", itertools.count().__next__)  # as if there always was something to do
    with caplog.at_level(logging.WARNING):
        warm_up.warm_up(kernels._tell_compiled)
    told = [record.getMessage() for record in caplog.records]
    assert told[0] == f"compiling the filter, once on this machine: 1 of {len(told)}"
    assert told[-1].endswith(f"{len(told)} of {len(told)}")


def test_what_is_compiled_is_not_compiled_again() -> None:
    warm_up.warm_up(lambda _number, _count: None)
    told: list[int] = []
    warm_up.warm_up(lambda number, _count: told.append(number))
    assert told == []
