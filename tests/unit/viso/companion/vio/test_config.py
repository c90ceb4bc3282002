# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The configuration: defaults, ranges, unknown keys."""

import contextlib
import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.vio.config import (
    AglSource,
    ConfigError,
    OdometryConfig,
    Scene,
    VioConfig,
    config_from_table,
    config_from_text,
    load_config,
)

FULL = """
[vio]
strategy = "fixed_lag"
working_width_px = 640
max_features = 200
fb_threshold_px = 1
ransac_threshold_px = 2.0
min_tracked = 20
lost_frames_fatal = 30
degraded_inflation = 9.0
max_position_sigma_m = 30
max_velocity_sigma_m_s = 2.0
auto_reinit_s = 5.0
scene = "planar"
agl_source = "baro"
agl_sigma_m = 0.5
agl_scale_sigma = 0.03
ground_z_m = -40.0
window_clones = 8
clahe = true
seed = 7
threads = 2

[vio.imu_noise]
gyro = 1e-3
accel = 1e-2
gyro_walk = 1e-5
accel_walk = 1e-4

[vio.odometry]
rate_hz = 30.0
covariance_encoding = "ardupilot_error"
local_alignment = "heading0"
lost_policy = { send_s = 1.0 }
system_id = 2
component_id = 198

[vio.queue]
depth = 2

[vio.engine]
command = "./my_engine --fast"
start_timeout_s = 30
frame_timeout_s = 0.5
mask = "mask.png"
covariance_scale = 16
drift_rad = 0.01
drift_m = 0.1
drift_share = 0.05

[vio.native]
estimate_extrinsic = 1
solver_time_s = 0.04
vocabulary = "small.bin"
loop_closure = true
"""

BAD = {
    "[vio]\nfoo = 1": "vio.foo: unknown key",
    "[camera]\nx = 1": "camera: unknown key",
    "[vio.odometry]\nrate = 5": "vio.odometry.rate: unknown key",
    "[vio.imu_noise]\ngyr = 1.0": "vio.imu_noise.gyr: unknown key",
    "[vio.odometry]\nrate_hz = 3.9": "vio.odometry.rate_hz: 3.9 is not within 4 to 200",
    "[vio.odometry.lost_policy]\nsend_s = -1": "vio.odometry.lost_policy.send_s: -1.0 is not within 0 to 60",
    "[vio.queue]\ndepth = 0": "vio.queue.depth: 0 is not within 1 to 16",
    "[vio]\nagl_sigma_m = nan": "vio.agl_sigma_m: nan is not within 0.001 to 100",
    "[vio.imu_noise]\ngyro = 0.0": "vio.imu_noise.gyro: not positive and finite",
    "[vio]\nscene = 'sea'": "vio.scene: 'sea' is none of general, planar, auto",
    "[vio]\nclahe = 1": "vio.clahe: 1 is no bool",
    "[vio]\nthreads = true": "vio.threads: True is no int",
    "[vio]\nthreads = 2.0": "vio.threads: 2.0 is no int",
    "[vio]\nstrategy = 5": "vio.strategy: 5 is no str",
    "[vio]\nscene = 5": "vio.scene: 5 is none of general, planar, auto",
    "[vio]\nqueue = 5": "vio.queue: not a table",
    "[vio]\nnative = 5": "vio.native: not a table",
    "[vio.native]\nlist = [1]": "vio.native.list: neither a number nor a text nor true or false",
    "vio = 5": "vio: not a table",
    "[vio]\nmin_tracked = 200": "vio.min_tracked: 200 is more than max_features (180)",
    "vio = " + "[" * 5000: "nested too deeply",
    "[vio": "not TOML: Expected ']' at the end of a table declaration (at end of document)",
}


def test_defaults_are_those_of_an_empty_file() -> None:
    assert config_from_text("", "f") == VioConfig()


def test_defaults() -> None:
    assert VioConfig().effective() == {
        "strategy": "klt_ransac",
        "working_width_px": 1400,
        "max_features": 180,
        "fb_threshold_px": 0.7,
        "ransac_threshold_px": 1.0,
        "min_tracked": 30,
        "lost_frames_fatal": 9,
        "degraded_inflation": 4.0,
        "max_position_sigma_m": 20.0,
        "max_velocity_sigma_m_s": 1.0,
        "auto_reinit_s": 0.0,
        "scene": "auto",
        "agl_source": "none",
        "agl_sigma_m": 0.3,
        "agl_scale_sigma": 0.02,
        "ground_z_m": 0.0,
        "window_clones": 11,
        "clahe": False,
        "seed": 0,
        "threads": 1,
        "imu_noise": {"gyro": 1.7e-3, "accel": 2e-2, "gyro_walk": 2e-5, "accel_walk": 1e-3},
        "odometry": {
            "rate_hz": 20.0,
            "covariance_encoding": "variance",
            "local_alignment": "north",
            "lost_policy": {"send_s": 3.0},
            "system_id": 1,
            "component_id": 197,
        },
        "queue": {"depth": 1},
        "engine": {
            "command": "",
            "start_timeout_s": 10.0,
            "frame_timeout_s": 1.0,
            "mask": "",
            "covariance_scale": 1.0,
            "drift_rad": 0.005,
            "drift_m": 0.02,
            "drift_share": 0.02,
        },
        "native": {},
    }


def test_every_key_can_be_set() -> None:
    changed, default = config_from_text(FULL, "f"), VioConfig()
    sections: list[tuple[Any, Any]] = [
        (changed, default),
        (changed.odometry, default.odometry),
        (changed.queue, default.queue),
        (changed.imu_noise, default.imu_noise),
        (changed.engine, default.engine),
    ]
    for set_section, default_section in sections:
        for field in dataclasses.fields(default_section):
            assert getattr(set_section, field.name) != getattr(default_section, field.name), field.name


def test_choices_become_members() -> None:
    config = config_from_text(FULL, "f")
    assert (config.scene, config.agl_source) == (Scene.PLANAR, AglSource.BARO)


def test_options_of_an_engine_are_handed_on_as_they_are() -> None:
    options = config_from_text(FULL, "f").native
    assert options == {"estimate_extrinsic": 1, "solver_time_s": 0.04, "vocabulary": "small.bin", "loop_closure": True}
    assert [type(value) for value in options.values()] == [int, float, str, bool]


def test_whole_number_is_a_float_too() -> None:
    assert type(config_from_text(FULL, "f").fb_threshold_px) is float


@pytest.mark.parametrize(("text", "error"), BAD.items(), ids=BAD.values())
def test_bad_text_gives_one_line(text: str, error: str) -> None:
    with pytest.raises(ConfigError) as caught:
        config_from_text(text, "vio.toml")
    assert str(caught.value) == f"vio.toml: {error}"


def test_rules_hold_without_a_file_too() -> None:
    with pytest.raises(ValueError, match=r"rate_hz: 3\.0 is not within 4 to 200"):
        OdometryConfig(rate_hz=3.0)


def test_effective_values_read_back() -> None:
    config = config_from_text(FULL, "f")
    assert config_from_table({"vio": json.loads(json.dumps(config.effective()))}, "f") == config


def test_digest_tells_configurations_apart() -> None:
    one, other = VioConfig(seed=1), VioConfig(seed=2)
    assert one.digest() != other.digest()
    assert one.digest() == VioConfig(seed=1).digest()
    assert len(bytes.fromhex(one.digest())) == 32


def test_digest_does_not_depend_on_how_a_value_is_written() -> None:
    assert config_from_text("[vio]\nagl_sigma_m = 1", "f").digest() == VioConfig(agl_sigma_m=1.0).digest()


def test_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "vio.toml"
    path.write_text(FULL, encoding="utf-8")
    assert load_config(path).strategy == "fixed_lag"


def test_missing_file_gives_one_line(tmp_path: Path) -> None:
    path = tmp_path / "vio.toml"
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert str(caught.value) == f"{path}: No such file or directory"


def test_binary_file_gives_one_line(tmp_path: Path) -> None:
    path = tmp_path / "vio.toml"
    path.write_bytes(b"\xff\x00")
    with pytest.raises(ConfigError, match="not UTF-8 text"):
        load_config(path)


VALUES = st.recursive(
    st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
    max_leaves=4,
)
KEYS = st.sampled_from([*(field.name for field in dataclasses.fields(VioConfig)), "foo"])


@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_whatever_table_is_a_configuration_or_an_error(table: dict[str, object]) -> None:
    with contextlib.suppress(ConfigError):
        assert isinstance(config_from_table({"vio": table}, "f"), VioConfig)
