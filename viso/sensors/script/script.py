# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that moves as a script says; ``script_file`` describes the scripts."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Final

from ekf_stub.inputs.sensors import Sensors
from viso.errors import InputError
from viso.files.text_files import read_text
from viso.sensors.motion import State, Truth, delta_between
from viso.sensors.options import ImuOptions
from viso.sensors.readings import last_reading_us
from viso.sensors.script.legs import TURN
from viso.sensors.script.script_file import EXAMPLES, Script, parse_script
from viso.sensors.source import VehicleSource

FIRST_INTERVAL_US: Final = 2500


class ScriptSource(VehicleSource):
    """The sensors of a vehicle that moves as a script says.

    Inertial data are integrals over the time since the last pass, however long that was: the change of velocity without
    gravity as it is felt in the body's mean attitude, and the rotation. Adding them up gives the trajectory.
    """

    def __init__(self, options: ImuOptions, script: Script) -> None:
        super().__init__(options)
        self._trajectory = script.trajectory
        self._start_us = None if script.start_s is None else round(1e6 * script.start_s)
        self._delay_us = round(1e6 * script.delay_s)
        self._armed = False
        self._last_us: int | None = None
        self._last = self._trajectory.at(0.0)

    def sense(self, now_us: int) -> Sensors | None:
        """Return what the sensors say, or None for a time that has been."""
        if self._start_us is None and self._armed:
            self._start_us = now_us + self._delay_us
        if self._last_us is None:
            self._last_us = now_us - FIRST_INTERVAL_US
            self._last = self._state(self._last_us)
        if now_us <= self._last_us:
            return None
        before, now = self._last, self._state(now_us)
        dt = 1e-6 * (now_us - self._last_us)
        self._last_us, self._last = now_us, now
        if now_us > self._next_reading_us:
            then = self._state(last_reading_us(now_us) or 0)
            self._read(now_us, 0.0 - then.pos[2], then.quat)
        return self._model.apply(Sensors(delta_between(before, now, dt), self._baro, self._mag))

    def _state(self, time_us: int) -> State:
        return self._trajectory.at(0.0 if self._start_us is None else 1e-6 * (time_us - self._start_us))

    def set_armed(self, armed: bool) -> None:
        """Hear whether the vehicle is armed; a script may wait for it."""
        self._armed = armed

    def is_at_rest(self, until_us: int) -> bool:
        """Move at any time, for all that is known."""
        return False

    def yaw_rad(self) -> float:
        """Return the heading at the last pass in rad, -pi..pi."""
        return math.remainder(self._last.yaw_rad, TURN)

    def truth(self, now_us: int) -> Truth:
        """Return where the vehicle is at a time in us since boot; until the script starts it stands."""
        state = self._state(now_us)
        quat = state.quat
        return Truth(state.pos, state.vel, (quat.w, quat.x, quat.y, quat.z))


def read_script_source(argument: str) -> Callable[[ImuOptions], ScriptSource]:
    """Return what makes sources from a script's file or an example's name. Raises InputError if it cannot be used."""
    path = EXAMPLES.get(argument, Path(argument))
    try:
        text = read_text(path)
    except InputError as error:
        raise InputError(f"{error}; examples that need no file are {', '.join(EXAMPLES)}") from error
    parse_script(text, str(path))
    return lambda options: ScriptSource(options, parse_script(text, str(path), options.heading_rad))
