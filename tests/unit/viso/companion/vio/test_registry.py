# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The factory of strategies, and what it says when there is none."""

import importlib.util
import logging
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.unit.viso.companion.vio.strategy_rig import (
    EventHandler,
    Ticks,
    WaxStrategy,
    make_calibration,
    make_logger,
)
from viso.companion.vio import registry
from viso.companion.vio.config import EngineConfig, VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.registry import FLAGS, STRATEGIES, StrategyEntry, build_vio_strategy, describe, read_flags
from viso.companion.vio.strategy import StrategyBase, StrategyContext

FLAGGED = ("klt_ransac", "fixed_lag", "okvis2", "vins_mono")
ALL_ON = dict.fromkeys(FLAGS, True)
ALL_OFF = dict.fromkeys(FLAGS, False)

MODULES = {
    "gtsam": "BUILD_FIXED_LAG",
    "viso_okvis2_native": "BUILD_OKVIS2",
    "viso_vins_mono_native": "BUILD_VINS_MONO",
}


@pytest.mark.parametrize("module", [None, *MODULES])
def test_strategies_are_there_with_their_modules(monkeypatch: pytest.MonkeyPatch, module: str | None) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", {module: object()}.get)
    assert read_flags() == {"BUILD_KLT_RANSAC": True} | {flag: name == module for name, flag in MODULES.items()}


def test_process_environment_has_no_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BUILD_OKVIS2", "1")
    assert read_flags()["BUILD_OKVIS2"] is False


def test_flags_are_read_once_and_cannot_be_set() -> None:
    with pytest.raises(TypeError):
        FLAGS["BUILD_OKVIS2"] = True  # type: ignore[index]  # that is the test


def build(name: str, flags: Mapping[str, bool]) -> tuple[StrategyBase, EventHandler]:
    logger, handler = make_logger()
    strategy = build_vio_strategy(VioConfig(strategy=name), make_calibration(), Ticks(), logger, flags=flags)
    return strategy, handler


def refusal(name: str, flags: Mapping[str, bool]) -> StrategyNotAvailableError:
    with pytest.raises(StrategyNotAvailableError) as caught:
        build(name, flags)
    assert caught.value.name == name
    return caught.value


@pytest.fixture
def wax(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = StrategyEntry("BUILD_KLT_RANSAC", WaxStrategy, "wax")
    monkeypatch.setitem(registry._STRATEGY_REGISTRY, "wax", entry)


def test_names() -> None:
    assert (*FLAGGED, "engine") == STRATEGIES


@pytest.mark.parametrize("name", STRATEGIES)
def test_each_has_its_flag_and_a_description(name: str) -> None:
    assert registry._STRATEGY_REGISTRY[name].flag == (f"BUILD_{name.upper()}" if name in FLAGGED else None)
    assert describe(name)


@pytest.mark.parametrize("name", ["okvis2", "vins_mono", "engine"])
def test_program_wants_no_flag(name: str) -> None:
    config = VioConfig(strategy=name, engine=EngineConfig(command="/nowhere"))
    with pytest.raises(StrategyNotAvailableError, match=r"/nowhere: No such file or directory$"):
        build_vio_strategy(config, make_calibration(), Ticks(), make_logger()[0], flags=ALL_OFF)


def test_unknown_name_lists_the_names_whatever_the_flags() -> None:
    with pytest.raises(
        ValueError, match=r"^strategy 'slam' is none of klt_ransac, fixed_lag, okvis2, vins_mono, engine$"
    ):
        build("slam", ALL_OFF)


@pytest.mark.parametrize("name", FLAGGED)
def test_flag_that_is_off_comes_before_the_import(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setitem(sys.modules, f"viso.companion.strategies.{name}", None)
    assert refusal(name, ALL_OFF).reason == f"flag BUILD_{name.upper()} is off"


@pytest.mark.parametrize("name", ["okvis2", "vins_mono"])
def test_native_strategies_are_off_by_default(name: str) -> None:
    assert refusal(name, FLAGS).reason == f"flag BUILD_{name.upper()} is off"


@pytest.mark.parametrize("name", ["okvis2", "vins_mono"])
def test_native_wiring_absent_even_when_the_flag_is_on(name: str) -> None:
    assert refusal(name, ALL_ON).reason == "native wiring absent"


@pytest.mark.parametrize(("name", "extra"), [("klt_ransac", "vio"), ("fixed_lag", "vio,gtsam")])
def test_import_that_fails_says_why_and_what_to_install(monkeypatch: pytest.MonkeyPatch, name: str, extra: str) -> None:
    module = f"viso.companion.strategies.{name}"
    monkeypatch.setitem(sys.modules, module, None)
    reason = refusal(name, ALL_ON).reason
    assert reason == f"import of {module} halted; None in sys.modules; pip install 'ardupilot-viso[{extra}]'"


def test_native_module_that_lacks_something_says_what(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "viso_okvis2_native.py").write_text("import viso_test_lib\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    assert refusal("okvis2", ALL_ON).reason == "No module named 'viso_test_lib'"


def test_refusal_is_one_line_with_the_name() -> None:
    assert str(refusal("okvis2", ALL_ON)) == "strategy okvis2 is not available: native wiring absent"


@pytest.mark.usefixtures("wax")
def test_strategy_gets_its_context() -> None:
    strategy, _ = build("wax", ALL_ON)
    assert isinstance(strategy, WaxStrategy)
    assert isinstance(strategy.context, StrategyContext)
    assert strategy.context.calibration.camera_id == "cam"


@pytest.mark.usefixtures("wax")
def test_ready_is_logged() -> None:
    _, handler = build("wax", ALL_ON)
    (record,) = handler.events("vio_ready")
    assert (record.levelno, record.getMessage()) == (logging.INFO, "VIO ready: strategy=wax, calibration=cam.7")


def test_refusal_is_not_ready() -> None:
    logger, handler = make_logger()
    with pytest.raises(StrategyNotAvailableError):
        build_vio_strategy(VioConfig(strategy="okvis2"), make_calibration(), Ticks(), logger, flags=ALL_ON)
    assert handler.records == []
