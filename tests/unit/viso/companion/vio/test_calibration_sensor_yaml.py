# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flat YAML of a camera in the EuRoC data sets."""

import re

import pytest

from viso.companion.vio.calibration import sensor_values

TEXT = """\
%YAML:1.0
---
# A camera.
sensor_type: camera
comment: "the left one"
T_BS:
  cols: 4
  rows: 4
  data: [0.0, 0.0, 1.0, 0.1,
        -1.0, 0.0, 0.0, 0.2,
         0.0, -1.0, 0.0, 0.3,
         0.0, 0.0, 0.0, 1.0]

rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.6, 457.2, 367.2, 248.3] # fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]
"""


def test_fields_go_by_our_names() -> None:
    assert sensor_values(TEXT, "cam0") == {
        "camera_id": "cam0",
        "unit": "0",
        "width": 752,
        "height": 480,
        "fx": 458.6,
        "fy": 457.2,
        "cx": 367.2,
        "cy": 248.3,
        "distortion_model": "radtan",
        "distortion": [-0.28, 0.07, 0.0002, 1.8e-05],
        "B_T_C": [[0, 0, 1, 0.1], [-1, 0, 0, 0.2], [0, -1, 0, 0.3], [0, 0, 0, 1]],
    }


@pytest.mark.parametrize("model", ["equidistant", "radtan"])
def test_model_may_go_by_its_short_name(model: str) -> None:
    assert sensor_values(TEXT.replace("radial-tangential", model), "cam0")["distortion_model"] == model


def test_camera_without_distortion_has_no_coefficients() -> None:
    text = TEXT.replace("radial-tangential", "none").replace("[-0.28, 0.07, 0.0002, 1.8e-05]", "[]")
    assert sensor_values(text, "cam0")["distortion"] == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rate_hz: 20", "shutter: global", "shutter: unknown"),
        ("resolution: [752, 480]", "", "resolution: missing"),
        ("camera_model: pinhole", "", "camera_model: missing"),
        ("pinhole", "omni", "camera_model: 'omni', not pinhole"),
        ("radial-tangential", "fov", "distortion_model: 'fov' is none of"),
        ("[752, 480]", "[752]", "resolution: 1 numbers, not 2"),
        ("[752, 480]", "[752.5, 480]", "resolution: not a list of numbers"),
        ("458.6, ", "", "intrinsics: 3 numbers, not 4"),
        ("458.6", "wide", "intrinsics: not a list of numbers"),
        (" 1.0]", " 1.0, 2.0]", "data: 17 numbers, not 16"),
        ("rate_hz: 20", "- a list", "'- a list': not understood"),
        ("1.8e-05]", "1.8e-05", "'distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05': not understood"),
    ],
)
def test_bad_text_is_refused_by_the_name_of_its_field(old: str, new: str, message: str) -> None:
    assert TEXT.count(old) == 1
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        sensor_values(TEXT.replace(old, new), "cam0")
