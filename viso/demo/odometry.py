# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration with a real odometry: a survey by a camera that looks down, covered twice; virtual time."""

import dataclasses
from collections.abc import Callable
from typing import Final

from viso.companion.vio.config import VioConfig
from viso.companion.world.ground import generate_texture
from viso.demo.loop import ARM_DISARM, ORIGIN, RUN_PREARM_CHECKS, CompanionLoop, LoopSetup
from viso.demo.survey_flight import SurveyPlan, survey_flight
from viso.firmware.releases import DEFAULT, Firmware
from viso.logs.logger import LogSink

COMPANION_S: Final = 7.0
PLAN: Final = SurveyPlan(
    climb_s=3.5,
    cruise_s=9.5,
    descent_s=31.0,
    landed_s=36.5,
    ramp_s=3.0,
    height_m=20.0,
    speed_m_s=6.0,
    extent_m=120.0,
    seed=5,
)
"""What is flown, in s from when the companion comes up."""

COVERED_S: Final = ((20.0, 22.0), (25.0, 31.0))
"""When the lens is covered, in s since boot: once for short, once for too long."""

RESTART_S: Final = 31.1
"""When the odometry restarts from the autopilot's state, in s since boot."""

ARM_S: Final = 9.5
DISARM_S: Final = 44.5
END_S: Final = 45.0
PARAMS: Final = {"LOG_DISARMED": 1, "LOG_REPLAY": 1}  # so that the filter can be run on the log
TEXTURE_PX: Final = 1024
TEXTURE_METRES_PER_PIXEL: Final = 0.1


def demo_setup(
    seed: int, firmware: Firmware = DEFAULT, choose: Callable[[VioConfig], VioConfig] = lambda config: config
) -> LoopSetup:
    """Return what the demonstration flies; the seed is that of all noise."""
    covered_s = tuple((start_s - COMPANION_S, end_s - COMPANION_S) for start_s, end_s in COVERED_S)
    texture = generate_texture(size_px=TEXTURE_PX, metres_per_pixel=TEXTURE_METRES_PER_PIXEL)
    flight = survey_flight(PLAN, END_S - COMPANION_S, seed=seed, texture=texture, covered_s=covered_s)
    companion_us = round(COMPANION_S * 1e6)
    setup = LoopSetup(flight=flight, companion_us=companion_us, params=PARAMS, seed=seed, firmware=firmware)
    return dataclasses.replace(setup, config=choose(setup.config))


class VioDemo:
    """One run of the demonstration.

    Args:
        seed: of all noise; the same seed gives the same log, byte for byte.
        choose: returns the odometry's configuration for the usual one.

    Attributes:
        loop: the vehicle, the companion and what has happened.

    Raises:
        StrategyNotAvailableError: if the odometry's libraries are not there.
        ModuleNotFoundError: if the renderer's are not.
    """

    def __init__(
        self,
        seed: int,
        open_log: Callable[[], LogSink],
        firmware: Firmware = DEFAULT,
        choose: Callable[[VioConfig], VioConfig] = lambda config: config,
    ) -> None:
        self.loop = CompanionLoop(demo_setup(seed, firmware, choose), open_log)

    def run(
        self,
        on_progress: Callable[[float], None] = lambda _time_s: None,
        stop: Callable[[], bool] = lambda: False,
    ) -> None:
        """Run to the end, or until ``stop`` returns true, and close the log."""
        loop, companion = self.loop, self.loop.companion
        script = [
            (COMPANION_S, lambda: loop.command(RUN_PREARM_CHECKS)),
            (COMPANION_S + 1.5, lambda: companion.sender.send(ORIGIN)),
            (ARM_S, lambda: loop.command(ARM_DISARM, 1)),
            (RESTART_S, companion.start_from),
            (DISARM_S, lambda: loop.command(ARM_DISARM, 0)),
        ]
        loop.play(script, END_S, on_progress, stop)
