# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters from files and from the command line, and errors that name the place."""

from pathlib import Path

import pytest

from viso.errors import InputError
from viso.firmware.releases import STABLE_4_6
from viso.terminal.settings import load_settings


def parm(path: Path, text: str, name: str = "vehicle.parm") -> Path:
    file = path / name
    file.write_text(text)
    return file


def test_nothing_given_sets_nothing() -> None:
    assert load_settings([], [], links=1) == {}


@pytest.mark.parametrize("text", ["VISO_TYPE 2", "VISO_TYPE,2", "VISO_TYPE\t2", "VISO_TYPE = 2", "VISO_TYPE=2"])
def test_forms_of_a_line_are_those_of_the_ground_stations(tmp_path: Path, text: str) -> None:
    assert load_settings([parm(tmp_path, text)], [], links=1) == {"VISO_TYPE": 2.0}


def test_comments_and_blank_lines_are_passed_over(tmp_path: Path) -> None:
    text = "# a comment\n\nVISO_TYPE 2  # T265\r\nVISO_POS_X 0.1\n"
    assert load_settings([parm(tmp_path, text)], [], links=1) == {"VISO_TYPE": 2.0, "VISO_POS_X": pytest.approx(0.1)}


def test_later_file_wins(tmp_path: Path) -> None:
    files = [parm(tmp_path, "VISO_TYPE 2", "a.parm"), parm(tmp_path, "VISO_TYPE 3", "b.parm")]
    assert load_settings(files, [], links=1) == {"VISO_TYPE": 3.0}


def test_assignment_wins_over_files(tmp_path: Path) -> None:
    assert load_settings([parm(tmp_path, "VISO_TYPE 2")], ["VISO_TYPE=1"], links=1) == {"VISO_TYPE": 1.0}


def test_later_assignment_wins() -> None:
    assert load_settings([], ["VISO_TYPE=2", "VISO_TYPE=1"], links=1) == {"VISO_TYPE": 1.0}


@pytest.mark.parametrize(
    ("text", "value"), [("=1", 1.0), ("=-0.5", -0.5), ("=1e3", 1000.0), (" 2", 2.0), (" = 2", 2.0)]
)
def test_forms_of_an_assignment(text: str, value: float) -> None:
    assert load_settings([], ["VISO_SCALE" + text], links=1) == {"VISO_SCALE": value}


@pytest.mark.parametrize("text", ["VISO_TYPE", "VISO_TYPE=", "=1", "", "VISO_TYPE=x", "VISO_TYPE=nan", "VISO_TYPE=inf"])
def test_assignment_of_another_form_is_refused(text: str) -> None:
    with pytest.raises(InputError) as raised:
        load_settings([], [text], links=1)
    assert str(raised.value) == f"--param {text!r}: not NAME=VALUE with a finite number"


def test_assignment_of_two_lines_is_refused() -> None:
    with pytest.raises(InputError, match="not NAME=VALUE"):
        load_settings([], ["VISO_TYPE=1\nVISO_SCALE=2"], links=1)


def test_assignment_to_an_unknown_parameter_is_refused() -> None:
    with pytest.raises(InputError) as raised:
        load_settings([], ["NO_SUCH=1"], links=1)
    assert str(raised.value) == "--param 'NO_SUCH=1': unknown parameter NO_SUCH"


def test_parameter_of_what_is_left_out_is_refused_with_the_reason() -> None:
    with pytest.raises(InputError, match=r"unknown parameter BCN_TYPE: range beacons are not fused here$"):
        load_settings([], ["BCN_TYPE=1"], links=1)


UNKNOWN = ["VISO_TIPE", "EK3_SRC4_YAW", "SERVO1_MIN"]


def test_unknown_names_have_a_line_each(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = parm(tmp_path, "VISO_TYPE 2\n\n" + "".join(f"{name} 1\n" for name in UNKNOWN))
    assert load_settings([path], [], links=1) == {"VISO_TYPE": 2.0}
    lines = [f"{path}:{n}: unknown parameter, passed over: {name}" for n, name in enumerate(UNKNOWN, 3)]
    assert caplog.messages == lines


@pytest.mark.parametrize("name", UNKNOWN)
def test_unknown_name_is_an_error_if_strict(tmp_path: Path, name: str) -> None:
    path = parm(tmp_path, f"VISO_TYPE 2\n\n{name} 1\n")
    with pytest.raises(InputError) as raised:
        load_settings([path], [], links=1, strict=True)
    assert str(raised.value) == f"{path}:3: unknown parameter: {name!r} (without --strict it is passed over)"


@pytest.mark.parametrize("text", ["VISO_TYPE=1,VISO_SCALE=2", "VISO_TYPE 1 VISO_SCALE 2"])
def test_several_assignments_in_one_are_refused(text: str) -> None:
    with pytest.raises(InputError) as raised:
        load_settings([], [text], links=1)
    assert str(raised.value) == f"--param {text!r}: not NAME=VALUE but more: give --param to each"


def test_choice_that_there_is_not_is_told(caplog: pytest.LogCaptureFixture) -> None:
    load_settings([], ["VISO_TYPE=9", "EK3_SRC1_YAW=6", "VISO_SCALE=9"], links=1)
    assert caplog.messages == [
        "VISO_TYPE is 9, which is not one of its values: 0 None, 1 MAVLink, 2 IntelT265, 3 VOXL(ModalAI)"
    ]


def test_name_that_asks_for_what_the_filter_does_not_do_is_kept(tmp_path: Path) -> None:
    assert load_settings([parm(tmp_path, "ARSPD_TYPE 1\n")], [], links=1) == {"ARSPD_TYPE": 1.0}


FORMS = {
    "MAVProxy": "{name:<16} {value:.6f}",
    "Mission Planner": "{name},{value:g}",
    "QGroundControl": "1\t1\t{name}\t{value:.18f}\t9",
}


@pytest.mark.parametrize("form", FORMS)
def test_file_of_a_whole_vehicle_is_read_and_what_is_foreign_told_in_one_line(
    tmp_path: Path, form: str, caplog: pytest.LogCaptureFixture
) -> None:
    params = {"SYSID_THISMAV": 7.0, "VISO_TYPE": 2.0, "ATC_RAT_RLL_P": 0.0, **{f"SERVO_{n}": n for n in range(300)}}
    path = parm(tmp_path, "\n".join(FORMS[form].format(name=name, value=value) for name, value in params.items()))
    settings = load_settings([path], [], links=1, firmware=STABLE_4_6, strict=True)
    assert settings == {"SYSID_THISMAV": 7.0, "VISO_TYPE": 2.0}
    names = ", ".join(["ATC_RAT_RLL_P", *(f"SERVO_{n}" for n in range(7))])
    assert caplog.messages == [f"{path}: without effect here, and passed over: {names} and 293 others"]


def test_unknown_name_of_external_navigation_has_a_line_in_a_file_of_a_whole_vehicle(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = parm(tmp_path, "".join(f"SERVO_{n} 1\n" for n in range(300)) + "VISO_TIPE 1\n")
    assert load_settings([path], [], links=1) == {}
    assert caplog.messages[0] == f"{path}:301: unknown parameter, passed over: VISO_TIPE"
    assert len(caplog.messages) == 2


@pytest.mark.parametrize("text", ["VISO_TYPE abc", "VISO_TYPE nan", "VISO_TYPE"])
def test_bad_number_in_a_file_is_an_error_with_its_line(tmp_path: Path, text: str) -> None:
    path = parm(tmp_path, f"VISO_SCALE 1\n{text}\n")
    with pytest.raises(InputError) as raised:
        load_settings([path], [], links=1)
    assert str(raised.value).startswith(f"{path}:2: ")
    assert "VISO_TYPE" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_parameters_of_a_link_need_that_link() -> None:
    assert load_settings([], ["MAV2_EXTRA1=4"], links=2) == {"MAV2_EXTRA1": 4.0}
    with pytest.raises(InputError, match="unknown parameter MAV2_EXTRA1"):
        load_settings([], ["MAV2_EXTRA1=4"], links=1)


def test_file_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.parm: No such file"):
        load_settings([tmp_path / "none.parm"], [], links=1)
