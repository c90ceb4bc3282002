# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that moves by a script; ``script_file`` describes the scripts."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Final

from ekf_stub.core.vectors import Quat
from ekf_stub.inputs.measurements import Array, InertialDelta
from ekf_stub.inputs.sensors import Sensors
from viso.errors import InputError
from viso.files.text_files import read_text
from viso.vehicle.sensors.motion import Moving, State, Truth, delta_between
from viso.vehicle.sensors.moving import MovingSource
from viso.vehicle.sensors.script.legs import TURN
from viso.vehicle.sensors.script.script_file import EXAMPLES, Script, parse_script
from viso.vehicle.sensors.source import ImuOptions, last_reading_us

FIRST_INTERVAL_US: Final = 2500


class ScriptedMotion(Moving[State]):
    """Moves by a script, from its start on, and stands until then.

    Attributes:
        start_us: when the script starts, since boot; None as long as nobody knows.
    """

    def __init__(self, script: Script) -> None:
        self._trajectory = script.trajectory
        self.start_us = None if script.start_s is None else round(1e6 * script.start_s)
        super().__init__(self._trajectory.at(0.0))

    def at(self, time_us: int) -> State:
        """Return the state at a time since boot."""
        return self._trajectory.at(0.0 if self.start_us is None else 1e-6 * (time_us - self.start_us))

    def moved(self, state: State, last_us: int | None, now_us: int) -> tuple[State, InertialDelta]:
        """Return the state at a time, from that of the pass before, and what ideal inertial sensors feel of it."""
        if last_us is None:
            last_us = now_us - FIRST_INTERVAL_US
            state = self.at(last_us)
        now = self.at(now_us)
        return now, delta_between(state, now, 1e-6 * (now_us - last_us))


class ScriptSource(MovingSource):
    """The sensors of a vehicle that moves by a script.

    Inertial data are integrals over the time since the last pass, however long that was: the change of velocity without
    gravity as it is felt in the body's mean attitude, and the rotation. Adding them up gives the trajectory.
    """

    def __init__(self, options: ImuOptions, script: Script) -> None:
        self._script = ScriptedMotion(script)
        super().__init__(options, self._script)
        self._delay_us = round(1e6 * script.delay_s)
        self._armed = False

    def _start_if_armed(self, now_us: int) -> None:
        if self._script.start_us is None and self._armed:
            self._script.start_us = now_us + self._delay_us
            self._script.think_again()

    def sense(self, now_us: int) -> Sensors | None:
        """Return the data of the sensors, or None for a time that has passed."""
        self._start_if_armed(now_us)
        return super().sense(now_us)

    def ahead(self, times_us: range) -> Array:
        """Return what passes get until the next reading."""
        self._start_if_armed(times_us[0])
        return super().ahead(times_us)

    def _shown(self, now_us: int) -> tuple[float, Quat]:
        then = self._script.at(last_reading_us(now_us) or 0)
        return 0.0 - then.pos[2], then.quat

    def set_armed(self, armed: bool) -> None:
        """Set whether the vehicle is armed; a script may wait for it."""
        self._armed = armed

    def is_at_rest(self, until_us: int) -> bool:
        """Move at any time, for all that is known."""
        return False

    def yaw_rad(self) -> float:
        """Return the heading at the last pass in rad, -pi..pi."""
        return math.remainder(self._script.state.yaw_rad, TURN)

    def truth(self, now_us: int) -> Truth:
        """Return where the vehicle is at a time in us since boot; until the script starts it stands."""
        return self._script.at(now_us).truth()


def read_script_source(argument: str) -> Callable[[ImuOptions], ScriptSource]:
    """Return what makes sources from a script's file or an example's name. Raises InputError if it cannot be used."""
    path = EXAMPLES.get(argument, Path(argument))
    try:
        text = read_text(path)
    except InputError as error:
        raise InputError(f"{error}; examples that need no file are {', '.join(EXAMPLES)}") from error
    parse_script(text, str(path))
    return lambda options: ScriptSource(options, parse_script(text, str(path), options.heading_rad))
