# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The factory of strategies, and what it says when there is none."""

import logging
import sys

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
from viso.companion.vio.pipeline import StrategyBase, StrategyContext
from viso.companion.vio.registry import STRATEGIES, StrategyEntry, all_strategies, build_vio_strategy

ENGINES = ("okvis2", "vins_mono", "engine")


def build(name: str) -> tuple[StrategyBase, EventHandler]:
    logger, handler = make_logger()
    strategy = build_vio_strategy(VioConfig(strategy=name), make_calibration(), Ticks(), logger)
    return strategy, handler


def refusal(name: str) -> StrategyNotAvailableError:
    with pytest.raises(StrategyNotAvailableError) as caught:
        build(name)
    assert caught.value.name == name
    return caught.value


@pytest.fixture
def wax(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = StrategyEntry(WaxStrategy, "wax")
    monkeypatch.setitem(registry._STRATEGY_REGISTRY, "wax", entry)


def test_names() -> None:
    assert ("klt_ransac", "fixed_lag", *ENGINES) == STRATEGIES


@pytest.mark.parametrize("name", STRATEGIES)
def test_each_has_a_description(name: str) -> None:
    entry = all_strategies()[name]
    assert entry.description
    assert entry.runs_programs == (name in ENGINES)


@pytest.mark.parametrize("name", ENGINES)
def test_program_that_does_not_start_says_why(name: str) -> None:
    config = VioConfig(strategy=name, engine=EngineConfig(command="/nowhere"))
    with pytest.raises(StrategyNotAvailableError, match=r"/nowhere: No such file or directory$"):
        build_vio_strategy(config, make_calibration(), Ticks(), make_logger()[0])


def test_unknown_name_lists_the_names() -> None:
    with pytest.raises(
        ValueError, match=r"^strategy 'slam' is none of klt_ransac, fixed_lag, okvis2, vins_mono, engine$"
    ):
        build("slam")


@pytest.mark.parametrize("name", ENGINES)
def test_engine_needs_a_program(name: str) -> None:
    assert refusal(name).reason == "vio.engine.command, or --engine, has to name its program"


@pytest.mark.parametrize(("name", "extra"), [("klt_ransac", "vio"), ("fixed_lag", "vio,gtsam")])
def test_import_that_fails_says_why_and_what_to_install(monkeypatch: pytest.MonkeyPatch, name: str, extra: str) -> None:
    module = f"viso.companion.strategies.{name}"
    monkeypatch.setitem(sys.modules, module, None)
    reason = refusal(name).reason
    assert reason == f"import of {module} halted; None in sys.modules; pip install 'ardupilot-viso[{extra}]'"


def test_refusal_is_one_line_with_the_name() -> None:
    assert str(refusal("okvis2")) == (
        "strategy okvis2 is not available: vio.engine.command, or --engine, has to name its program"
    )


@pytest.mark.usefixtures("wax")
def test_strategy_gets_its_context() -> None:
    strategy, _ = build("wax")
    assert isinstance(strategy, WaxStrategy)
    assert isinstance(strategy.context, StrategyContext)
    assert strategy.context.calibration.camera_id == "cam"


@pytest.mark.usefixtures("wax")
def test_ready_is_logged() -> None:
    _, handler = build("wax")
    (record,) = handler.events("vio_ready")
    assert (record.levelno, record.getMessage()) == (logging.INFO, "VIO ready: strategy=wax, calibration=cam.7")


def test_refusal_is_not_ready() -> None:
    logger, handler = make_logger()
    with pytest.raises(StrategyNotAvailableError):
        build_vio_strategy(VioConfig(strategy="okvis2"), make_calibration(), Ticks(), logger)
    assert handler.records == []
