# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which kind of source a name means, and the axes of its IMU."""

from pathlib import Path

import numpy as np
import pytest

from tests.unit.viso.companion.sources.film_maker import write_calibration, write_film, write_inertial_csv
from tests.unit.viso.companion.sources.gopro_maker import movie
from viso.companion.sources.base import Recording, SourceError, SourceOptions
from viso.companion.sources.camera import LiveCamera
from viso.companion.sources.kinds import SOURCES, kind_of, open_source
from viso.companion.vio.types import ImuSample


def test_name_tells_the_kind(tmp_path: Path) -> None:
    film = tmp_path / "gopro.mp4"
    film.write_bytes(movie([b"telemetry"]))
    names = {"synthetic": "synthetic", "synthetic:4": "synthetic", "0": "camera", "rtsp://x/y": "camera"}
    names |= {str(tmp_path): "euroc", str(film): "gopro", str(tmp_path / "film.avi"): "video"}
    assert {name: kind_of(name) for name in names} == names


@pytest.mark.parametrize("kind", SOURCES)
def test_every_kind_says_what_it_is_and_refuses_in_one_line(tmp_path: Path, kind: str) -> None:
    assert SOURCES[kind].summary
    with pytest.raises(SourceError):
        open_source(SourceOptions(str(tmp_path / "none:x")), kind)


def test_unknown_kind_is_told() -> None:
    with pytest.raises(SourceError, match=f"no source 'x'; there are {', '.join(SOURCES)}"):
        open_source(SourceOptions("0"), "x")


def test_camera_is_live(tmp_path: Path) -> None:
    options = SourceOptions("0", calibration=write_calibration(tmp_path / "small.toml"))
    assert isinstance(open_source(options), LiveCamera)


def first_sample(tmp_path: Path, **axes: object) -> ImuSample:
    options = SourceOptions(
        str(write_film(tmp_path / "film.avi")),
        calibration=write_calibration(tmp_path / "small.toml"),
        imu=write_inertial_csv(tmp_path / "imu.csv", 1.0, (1.0, 2.0, 3.0)),
        **axes,  # type: ignore[arg-type]
    )
    source = open_source(options)
    assert isinstance(source, Recording)
    sample = next(source.events())
    assert isinstance(sample, ImuSample)
    return sample


def test_inertial_data_become_those_of_the_body(tmp_path: Path) -> None:
    assert first_sample(tmp_path).accel.tolist() == [1, 2, 3]
    assert first_sample(tmp_path, imu_axes="FRD").accel.tolist() == [1, -2, -3]
    assert first_sample(tmp_path, mounting=np.diag([-1.0, -1.0, 1.0])).accel.tolist() == [-1, -2, 3]


def test_axes_that_are_none_are_told(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="axes of the IMU: 'FLD' are left-handed"):
        first_sample(tmp_path, imu_axes="FLD")
