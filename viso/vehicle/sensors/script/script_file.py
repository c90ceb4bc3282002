# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads scripted trajectories: TOML files that say when a vehicle moves, and through which legs.

A script begins and ends at rest, and so does each of its legs. An example::

    start = "armed"                       # or seconds since boot; the estimator wants some 6 s of rest at first
    delay_s = 2.0                         # after arming

    [[leg]]
    shape = "point"
    to_ned_m = [0.0, 0.0, -3.0]
    duration_s = 5.0

    [[leg]]
    shape = "figure_eight"
    length_m = 8.0
    width_m = 4.0
    period_s = 10.0
    laps = 5
    nose = "path"

Keys of the file:

=================  ================================================================================================
start              seconds since boot, or "armed" (default): when the vehicle is armed for the first time
delay_s            how long after arming; 0
attitude           "multirotor" (default): roll and pitch follow from the acceleration; "given": they are 0, or what
                   the legs say, as of a rover or a camera in the hand
position_ned_m     where the vehicle stands at first, m; [0, 0, 0]
heading_deg        where it points at first; as the command line says, or 0
=================  ================================================================================================

Keys of every leg: ``shape``, and those of its shape; lengths in m, times in s, angles in deg:

=============  ===================================  ===============================================================
shape          must be given                        may be given
=============  ===================================  ===============================================================
point          to_ned_m, duration_s                 yaw_deg, roll_deg, pitch_deg at the end (roll and pitch only if
                                                    the attitude is "given"); they stay as they are by default
hover          duration_s                           the same
line           length_m, period_s (there and back)  laps, bearing_deg, ramp_s
square         side_m, period_s (four sides)        laps, bearing_deg; it rests in the corners, and turns right
circle         radius_m, period_s                   laps, bearing_deg, ramp_s, nose; it turns right
figure_eight   length_m, width_m, period_s          laps, bearing_deg, ramp_s, nose
=============  ===================================  ===============================================================

``laps`` is how often (without end by default), ``bearing_deg`` the direction in which a shape lies (where the nose
points by default), ``ramp_s`` the time that the first lap takes to reach full speed and the last to lose it (a quarter
of the period by default, at least a twentieth), and ``nose`` whether yaw is "fixed" (default) or turns with the
direction of travel ("path"). To ``yaw_deg`` the vehicle turns the shorter way.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

from ekf_stub.core.inertial import GRAVITY_MSS
from viso.documents import parsed_toml
from viso.errors import InputError
from viso.vehicle.sensors.script.legs import (
    CurveAt,
    CurveLeg,
    Leg,
    Motion,
    PointLeg,
    ScriptedPath,
    SquareLeg,
    circle,
    figure_eight,
    line,
)
from viso.vehicle.sensors.script.toml_table import TomlTable
from viso.vehicle.sensors.vectors import Three

ARMED: Final = "armed"
MAX_M: Final = 1e4
MAX_S: Final = 1e6
MAX_DEG: Final = 1e5
MAX_LAPS: Final = 1_000_000
MAX_ACCEL_MSS: Final = 100.0
MIN_LIFT_MSS: Final = 1.0
_SHORTEST: Final = 0.01
_CHECKS: Final = 200

EXAMPLES: Final[Mapping[str, Path]] = MappingProxyType(
    {path.stem: path for path in sorted((Path(__file__).parent / "example_scripts").glob("*.toml"))}
)
"""Scripts that come with the package, by the names that may stand for their files."""


@dataclass(frozen=True)
class Script:
    """A trajectory, and when it starts: in s since boot, or None for a delay in s after arming."""

    trajectory: ScriptedPath
    start_s: float | None
    delay_s: float


def parse_script(text: str, name: str, heading_rad: float = 0.0) -> Script:
    """Return the script in a text; ``heading_rad`` holds where the script gives none.

    Raises InputError, naming the script, and leg and key, of what cannot be used.
    """
    try:
        values = parsed_toml(text)
    except ValueError as error:
        raise InputError(f"{name}: {error}") from error
    table = TomlTable(values, name)
    start_s, delay_s = _read_start(table)
    tilts = table.choice("attitude", ("multirotor", "given"), "multirotor") == "multirotor"
    heading_deg = table.number("heading_deg", -MAX_DEG, MAX_DEG, math.degrees(heading_rad))
    stands = table.three("position_ned_m", MAX_M, (0.0, 0.0, 0.0))
    legs = _read_legs(table, stands, math.radians(heading_deg), tilts=tilts)
    table.check_all_known()
    return Script(ScriptedPath(legs, tilts=tilts), start_s, delay_s)


def _read_start(table: TomlTable) -> tuple[float | None, float]:
    if not table.has("start") or table.get("start") == ARMED:
        return None, table.number("delay_s", 0.0, MAX_S, 0.0)
    if isinstance(table.get("start"), str):
        raise table.fail("start", f'neither "{ARMED}" nor seconds since boot')
    if table.has("delay_s"):
        raise table.fail("delay_s", f'only for start = "{ARMED}"')
    return table.number("start", 0.0, MAX_S), 0.0


def _read_legs(table: TomlTable, stands: Three, heading_rad: float, *, tilts: bool) -> list[Leg]:
    legs: list[Leg] = []
    end = Motion(stands, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, heading_rad))
    for leg_table in table.tables("leg"):
        if legs and math.isinf(legs[-1].duration_s):
            raise leg_table.fail("shape", "never comes, as the leg before has no laps and goes on for ever")
        leg = SHAPES[leg_table.choice("shape", SHAPES)](leg_table, end, tilts)
        leg_table.check_all_known()
        _check_acceleration(leg_table, leg, tilts=tilts)
        legs.append(leg)
        if math.isfinite(leg.duration_s):
            end = leg.at(leg.duration_s)
    return legs


def _check_acceleration(table: TomlTable, leg: Leg, *, tilts: bool) -> None:
    key = "duration_s" if isinstance(leg, PointLeg) else "period_s"
    span_s = min(leg.duration_s, 2.0 * table.number(key, 0.0, MAX_S))
    for check in range(_CHECKS):
        accel = leg.at(span_s * check / _CHECKS).acc
        if math.hypot(*accel) > MAX_ACCEL_MSS:
            raise table.fail(key, f"too short: accelerates by more than {MAX_ACCEL_MSS:g} m/s/s")
        if tilts and GRAVITY_MSS - accel[2] < MIN_LIFT_MSS:
            raise table.fail(key, "too short: a multirotor would have to fall")


def _read_rpy(table: TomlTable, start_rpy: Three, tilts: bool) -> Three:
    if tilts and (table.has("roll_deg") or table.has("pitch_deg")):
        raise table.fail("roll_deg, pitch_deg", 'only for attitude = "given"')
    roll, pitch, yaw = (math.degrees(angle) for angle in start_rpy)
    return (
        math.radians(table.number("roll_deg", -180.0, 180.0, roll)),
        math.radians(table.number("pitch_deg", -90.0, 90.0, pitch)),
        math.radians(yaw + math.remainder(table.number("yaw_deg", -MAX_DEG, MAX_DEG, yaw) - yaw, 360.0)),
    )


def _read_point(table: TomlTable, begin: Motion, tilts: bool) -> Leg:
    to = table.three("to_ned_m", MAX_M)
    return PointLeg(begin.pos, to, begin.rpy, _read_rpy(table, begin.rpy, tilts), _read_duration(table))


def _read_hover(table: TomlTable, begin: Motion, tilts: bool) -> Leg:
    return PointLeg(begin.pos, begin.pos, begin.rpy, _read_rpy(table, begin.rpy, tilts), _read_duration(table))


def _read_duration(table: TomlTable) -> float:
    return table.number("duration_s", _SHORTEST, MAX_S)


def _read_square(table: TomlTable, begin: Motion, _tilts: bool) -> Leg:
    side_m, period_s = _read_length(table, "side_m"), _read_period(table)
    return SquareLeg(begin.pos, begin.rpy, _read_bearing(table, begin), side_m, period_s, _read_laps(table))


def _read_line(table: TomlTable, begin: Motion, _tilts: bool) -> Leg:
    return _read_curve(table, begin, line(_read_length(table, "length_m")), turns=False)


def _read_circle(table: TomlTable, begin: Motion, _tilts: bool) -> Leg:
    return _read_curve(table, begin, circle(_read_length(table, "radius_m")), turns=_read_nose(table))


def _read_figure_eight(table: TomlTable, begin: Motion, _tilts: bool) -> Leg:
    curve = figure_eight(_read_length(table, "length_m"), _read_length(table, "width_m"))
    return _read_curve(table, begin, curve, turns=_read_nose(table))


def _read_curve(table: TomlTable, begin: Motion, curve: CurveAt, *, turns: bool) -> Leg:
    period_s = _read_period(table)
    ramp_s = table.number("ramp_s", 0.05 * period_s, period_s, 0.25 * period_s)
    bearing_rad, laps = _read_bearing(table, begin), _read_laps(table)
    return CurveLeg(curve, begin.pos, begin.rpy, bearing_rad, period_s, ramp_s, laps, turns)


def _read_length(table: TomlTable, key: str) -> float:
    return table.number(key, _SHORTEST, MAX_M)


def _read_period(table: TomlTable) -> float:
    return table.number("period_s", 0.1, MAX_S)


def _read_laps(table: TomlTable) -> float:
    return table.count("laps", MAX_LAPS, math.inf)


def _read_bearing(table: TomlTable, begin: Motion) -> float:
    return math.radians(table.number("bearing_deg", -MAX_DEG, MAX_DEG, math.degrees(begin.rpy[2])))


def _read_nose(table: TomlTable) -> bool:
    return table.choice("nose", ("fixed", "path"), "fixed") == "path"


SHAPES: Final[Mapping[str, Callable[[TomlTable, Motion, bool], Leg]]] = MappingProxyType(
    {
        "point": _read_point,
        "hover": _read_hover,
        "line": _read_line,
        "square": _read_square,
        "circle": _read_circle,
        "figure_eight": _read_figure_eight,
    }
)
"""How the keys of a leg are read, by its shape."""
