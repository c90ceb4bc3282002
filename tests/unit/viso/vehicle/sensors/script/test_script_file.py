# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A script says when a vehicle moves and where; what it cannot say is refused with the key that says it."""

import math
import textwrap

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.core.vectors import euler_of
from viso.errors import InputError
from viso.vehicle.sensors.script import script_file
from viso.vehicle.sensors.script.script_file import EXAMPLES, SHAPES, Script, parse_script
from viso.vehicle.sensors.vectors import to_body

HOVER = '[[leg]]\nshape = "hover"\nduration_s = 2.0\n'
POINT = '[[leg]]\nshape = "point"\nto_ned_m = [1, 2, -3]\nduration_s = 4\n'
CIRCLE = '[[leg]]\nshape = "circle"\nradius_m = 2\nperiod_s = 8\n'
LINE = '[[leg]]\nshape = "line"\nlength_m = 2\nperiod_s = 8\n'
SQUARE = '[[leg]]\nshape = "square"\nside_m = 2\nperiod_s = 8\n'
EIGHT = '[[leg]]\nshape = "figure_eight"\nlength_m = 4\nwidth_m = 2\nperiod_s = 8\n'
GIVEN = 'attitude = "given"\n'


def parse(text: str, heading_rad: float = 0.0) -> Script:
    return parse_script(text, "flight.toml", heading_rad)


def rpy_deg(script: Script, t: float) -> tuple[float, ...]:
    return tuple(map(math.degrees, euler_of(script.trajectory.at(t).quat)))


def error_of(text: str) -> str:
    with pytest.raises(InputError) as raised:
        parse(text)
    return str(raised.value)


@pytest.mark.parametrize(("text", "start_s", "delay_s"), [
    ("", None, 0.0),
    ('start = "armed"\n', None, 0.0),
    ('start = "armed"\ndelay_s = 2.5\n', None, 2.5),
    ("start = 30\n", 30.0, 0.0),
    ("start = 0.5\n", 0.5, 0.0),
])  # fmt: skip
def test_start_is_a_time_or_arming(text: str, start_s: float | None, delay_s: float) -> None:
    script = parse(text + HOVER)
    assert (script.start_s, script.delay_s) == (start_s, delay_s)


def test_vehicle_stands_as_the_script_says_at_first() -> None:
    script = parse("position_ned_m = [1, 2.5, -3]\nheading_deg = 90\n" + HOVER, heading_rad=1.0)
    assert script.trajectory.at(-1.0).pos == (1, 2.5, -3)
    assert rpy_deg(script, -1.0) == pytest.approx((0, 0, 90))


def test_heading_is_given_where_the_script_has_none() -> None:
    assert rpy_deg(parse(HOVER, heading_rad=1.0), 0.0) == pytest.approx((0, 0, math.degrees(1.0)))


def test_legs_follow_each_other() -> None:
    trajectory = parse(POINT + CIRCLE + "laps = 1\n" + HOVER + LINE).trajectory
    assert trajectory.at(4.0).pos == pytest.approx((1, 2, -3))
    assert trajectory.at(4.0 + 5.0).pos == pytest.approx((1, 6, -3), abs=1e-9)  # a lap takes 10 s with its ramps
    assert trajectory.at(14.0).pos == pytest.approx((1, 2, -3), abs=1e-9)
    assert trajectory.at(15.0).pos == pytest.approx((1, 2, -3), abs=1e-9)
    assert trajectory.at(16.0 + 5.0).pos == pytest.approx((3, 2, -3), abs=1e-9)
    assert math.isinf(trajectory.duration_s)


def test_vehicle_rests_where_the_script_ends() -> None:
    trajectory = parse(POINT + HOVER).trajectory
    assert trajectory.duration_s == 6.0
    assert trajectory.at(1e6) == trajectory.at(6.0)
    assert (trajectory.at(1e6).pos, trajectory.at(1e6).vel) == ((1, 2, -3), (0, 0, 0))


def test_shapes_lie_where_the_nose_points() -> None:
    for turned in (parse("heading_deg = 90\n" + LINE), parse(LINE + "bearing_deg = 90\n")):
        assert turned.trajectory.at(5.0).pos == pytest.approx((0, 2, 0), abs=1e-9)


def test_ramp_is_a_quarter_of_the_period() -> None:
    assert parse(CIRCLE + "laps = 1\n").trajectory.duration_s == 10.0
    assert parse(CIRCLE + "laps = 1\nramp_s = 4\n").trajectory.duration_s == 12.0


def test_multirotor_leans_into_its_acceleration() -> None:
    script = parse("heading_deg = 30\n" + POINT)
    for t in (0.5, 1.5, 3.0):
        state, step_s = script.trajectory.at(t), 1e-4
        around = [script.trajectory.at(t + sign * step_s).vel for sign in (-1, 1)]
        accel = [(after - before) / (2 * step_s) for before, after in zip(*around, strict=True)]
        felt = to_body(state.quat, (accel[0], accel[1], accel[2] - 9.80665))
        assert felt[:2] == pytest.approx([0, 0], abs=1e-5)
        assert felt[2] < 0
        assert rpy_deg(script, t)[2] == pytest.approx(30)


def test_attitude_may_be_given() -> None:
    turn = "roll_deg = 10\npitch_deg = -20\nyaw_deg = 30\n"
    script = parse(GIVEN + HOVER + turn + POINT)
    assert rpy_deg(script, 0.0) == pytest.approx((0, 0, 0))
    assert rpy_deg(script, 1.0) == pytest.approx((5, -10, 15))
    assert rpy_deg(script, 4.0) == pytest.approx((10, -20, 30))


@pytest.mark.parametrize(("heading", "yaw", "halfway"), [(350, 10, 0), (10, 350, 0), (-90, 720, -45), (0, 90, 45)])
def test_yaw_turns_the_shorter_way(heading: int, yaw: int, halfway: int) -> None:
    script = parse(f"heading_deg = {heading}\n{HOVER}yaw_deg = {yaw}\n")
    difference = rpy_deg(script, 1.0)[2] - halfway
    assert math.remainder(difference, 360) == pytest.approx(0, abs=1e-9)


def test_vehicle_does_not_unwind_its_laps() -> None:
    script = parse(CIRCLE + 'laps = 3\nnose = "path"\n' + HOVER + "yaw_deg = 90\n")
    assert rpy_deg(script, 26.0 + 1.0)[2] == pytest.approx(45)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_scripts(name: str) -> None:
    script = parse_script(EXAMPLES[name].read_text(encoding="utf-8"), name)
    start, end = (script.trajectory.at(t) for t in (0.0, script.trajectory.duration_s))
    assert math.isinf(script.trajectory.duration_s) or end.pos == pytest.approx(start.pos)


def test_every_shape_is_documented() -> None:
    for shape in SHAPES:
        assert f"\n{shape} " in str(script_file.__doc__)


def test_documented_example_is_a_script() -> None:
    _, _, rest = str(script_file.__doc__).partition("An example::\n")
    example, _, _ = rest.partition("\nKeys of the file:")
    script = parse(textwrap.dedent(example))
    assert (script.start_s, script.delay_s, script.trajectory.duration_s) == (None, 2.0, 57.5)


@pytest.mark.parametrize(("text", "error"), [
    ("start = ", "not TOML: Invalid value (at end of document)"),
    ("", "leg: missing"),
    ("leg = []", "leg: not [[leg]] tables"),
    ("leg = [1]", "leg: not [[leg]] tables"),
    ("[leg]", "leg: not [[leg]] tables"),
    ('start = "now"\n' + HOVER, 'start: neither "armed" nor seconds since boot'),
    ("start = -1\n" + HOVER, "start: not a number from 0 to 1e+06"),
    ("start = true\n" + HOVER, "start: not a number from 0 to 1e+06"),
    ("start = nan\n" + HOVER, "start: not a number from 0 to 1e+06"),
    ("start = 1\ndelay_s = 1\n" + HOVER, 'delay_s: only for start = "armed"'),
    ("delay_s = inf\n" + HOVER, "delay_s: not a number from 0 to 1e+06"),
    ('attitude = "level"\n' + HOVER, "attitude: not one of multirotor, given"),
    ("attitude = 1\n" + HOVER, "attitude: not one of multirotor, given"),
    ("heading_deg = [1]\n" + HOVER, "heading_deg: not a number from -100000 to 100000"),
    ("position_ned_m = [1, 2]\n" + HOVER, "position_ned_m: not three numbers from -10000 to 10000"),
    ("position_ned_m = [1, 2, 1e5]\n" + HOVER, "position_ned_m: not three numbers from -10000 to 10000"),
    ("position_ned_m = 1\n" + HOVER, "position_ned_m: not three numbers from -10000 to 10000"),
    ("speed = 1\n" + HOVER,
     "speed: no such key here; there are start, delay_s, attitude, heading_deg, position_ned_m, leg"),
    (HOVER + "[[leg]]\n", "leg 2: shape: missing"),
    ('[[leg]]\nshape = "spiral"\n', "leg 1: shape: not one of point, hover, line, square, circle, figure_eight"),
    ('[[leg]]\nshape = "point"\nduration_s = 1\n', "leg 1: to_ned_m: missing"),
    (HOVER + POINT.replace("4", "0"), "leg 2: duration_s: not a number from 0.01 to 1e+06"),
    (HOVER + POINT.replace("4", '"4"'), "leg 2: duration_s: not a number from 0.01 to 1e+06"),
    (CIRCLE.replace("2", "0x" + 5000 * "f"), "a whole number of more than 64 bits"),
    (CIRCLE + "laps = 1.5\n", "leg 1: laps: not a whole number from 1 to 1000000"),
    (CIRCLE + "laps = 0\n", "leg 1: laps: not a whole number from 1 to 1000000"),
    (CIRCLE + "laps = true\n", "leg 1: laps: not a whole number from 1 to 1000000"),
    (CIRCLE + "ramp_s = 8.5\n", "leg 1: ramp_s: not a number from 0.4 to 8"),
    (CIRCLE + 'nose = "north"\n', "leg 1: nose: not one of fixed, path"),
    (LINE + 'nose = "path"\n',
     "leg 1: nose: no such key here; there are shape, length_m, period_s, ramp_s, bearing_deg, laps"),
    (SQUARE + "ramp_s = 1\n",
     "leg 1: ramp_s: no such key here; there are shape, side_m, period_s, bearing_deg, laps"),
    (EIGHT.replace("width_m", "height_m"), "leg 1: width_m: missing"),
    (HOVER + "roll_deg = 1\n", 'leg 1: roll_deg, pitch_deg: only for attitude = "given"'),
    (HOVER + "pitch_deg = 1\n", 'leg 1: roll_deg, pitch_deg: only for attitude = "given"'),
    (GIVEN + HOVER + "pitch_deg = 91\n", "leg 1: pitch_deg: not a number from -90 to 90"),
    (CIRCLE + HOVER, "leg 2: shape: never comes, as the leg before has no laps and goes on for ever"),
    (POINT.replace("4", "1.2"), "leg 1: duration_s: too short: a multirotor would have to fall"),
    (GIVEN + POINT.replace("4", "0.1"), "leg 1: duration_s: too short: accelerates by more than 100 m/s/s"),
    (CIRCLE.replace("8", "0.8"), "leg 1: period_s: too short: accelerates by more than 100 m/s/s"),
    (SQUARE.replace("8", "1"), "leg 1: period_s: too short: accelerates by more than 100 m/s/s"),
])  # fmt: skip
def test_unusable_script_is_refused(text: str, error: str) -> None:
    assert error_of(text) == f"flight.toml: {error}"


@pytest.mark.slow
@given(st.text())
def test_any_text_is_a_script_or_refused(text: str) -> None:
    assert error_of(text).startswith("flight.toml: ")


@pytest.mark.parametrize(
    ("text", "error"),
    [("a = " + 5000 * "9", "not TOML: "), ("a = " + 5000 * "[", "nested too deeply"), ("a = 1\na = 2", "not TOML: ")],
)
def test_text_that_is_no_toml_is_refused(text: str, error: str) -> None:
    assert error_of(text).startswith(f"flight.toml: {error}")
    assert "\n" not in error_of(text)
