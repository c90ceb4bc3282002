# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed loops as tests want them: with a small camera, low and slow, and short."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Final

from viso.companion.world.flight import nadir_calibration
from viso.companion.world.ground import generate_texture
from viso.demo.errors import PoseErrors
from viso.demo.loop import ARM_DISARM, ORIGIN, CompanionLoop, LoopSetup
from viso.demo.survey_flight import SurveyPlan, survey_flight
from viso.logs.logger import LogSink, MemoryLog

COMPANION_S: Final = 6.5
ORIGIN_S: Final = 7.5
ARM_S: Final = 8.5
PLAN: Final = SurveyPlan(climb_s=2.5, cruise_s=6.5, ramp_s=2.0, height_m=12.0, speed_m_s=4.0)

Script = Sequence[tuple[float, Callable[[CompanionLoop], None]]]


def make_setup(
    end_s: float,
    *,
    covered_s: Sequence[tuple[float, float]] = (),
    params: Mapping[str, float] | None = None,
    plan: SurveyPlan = PLAN,
) -> LoopSetup:
    """Return what is flown; all times are in s since boot, those of the plan from when the companion comes up."""
    covered = tuple((start_s - COMPANION_S, end_s - COMPANION_S) for start_s, end_s in covered_s)
    texture = generate_texture(size_px=512)
    flight = survey_flight(plan, end_s - COMPANION_S, seed=3, texture=texture, covered_s=covered)
    flight = dataclasses.replace(flight, calibration=nadir_calibration(320, 240, 250.0))
    return LoopSetup(flight=flight, companion_us=round(COMPANION_S * 1e6), params=params or {}, seed=3)


def set_origin(loop: CompanionLoop) -> None:
    """Tell the autopilot where it is."""
    loop.companion.sender.send(ORIGIN)


def arm(loop: CompanionLoop) -> None:
    """Ask the autopilot to arm."""
    loop.command(ARM_DISARM, 1)


def play(
    setup: LoopSetup, end_s: float, script: Script = (), open_log: Callable[[], LogSink] = MemoryLog
) -> CompanionLoop:
    """Run a loop: arm, then do what is in the script, until the end."""
    loop = CompanionLoop(setup, open_log)
    for time_s, act in [(ORIGIN_S, set_origin), (ARM_S, arm), *script]:
        loop.run_until(round(time_s * 1e6))
        act(loop)
    loop.run_until(round(end_s * 1e6))
    loop.close()
    return loop


HOP: Final = SurveyPlan(climb_s=1.5, cruise_s=4.0, ramp_s=2.0, height_m=4.0, speed_m_s=2.0)
HOP_COVERED_S: Final = (11.0, 12.0)
HOP_RESTART_S: Final = 13.0
HOP_END_S: Final = 14.5


@cache
def hop() -> CompanionLoop:
    """A few seconds in the air, the lens covered for one, then restarted."""
    setup = make_setup(HOP_END_S, covered_s=[HOP_COVERED_S], plan=HOP)
    return play(setup, HOP_END_S, [(HOP_RESTART_S, lambda loop: loop.companion.start_from())])


def between(errors: PoseErrors, start_s: float, end_s: float) -> PoseErrors:
    """Return the errors within a span of time."""
    return errors.chosen((errors.t_s >= start_s) & (errors.t_s < end_s))
