# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale and the axes of positions are told by the vehicle's own path, if that is not made of them."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    GLOBAL_POSITION_INT,
    GPS_RAW_INT,
    HEARTBEAT,
    LOCAL_POSITION_NED,
    PARAM_VALUE,
    SCALED_PRESSURE,
)
from tests.places import RECORDED
from tests.unit.viso.doctor.evidences import START_US, changed, evidence_of, findings_of, pose, stream_of
from tests.unit.viso.doctor.streams import LEAD_US, codes, examine, faulty, piece, shifted
from tests.unit.viso.report.log_maker import LogMaker
from viso.doctor import Finding, Severity
from viso.doctor.evidence.compare import compare_paths
from viso.doctor.evidence.gathering import gather
from viso.doctor.evidence.tracks import Floats
from viso.doctor.evidence.vehicle_data import VehicleData, listen, vehicle_of_log
from viso.doctor.evidence.vehicle_position import (
    PositionListener,
    PositionSeries,
    is_independent,
    level_in,
    ned_of_degrees,
    position_in,
    sources_of,
)
from viso.logs.recorded import read_recorded_states
from viso.streams.stream_kinds import Stream, StreamMessage

COUNT = 400
PERIOD_US = 40_000
GPS = {"EK3_SRC1_POSXY": 3.0, "EK3_SRC1_VELXY": 3.0, "EK3_SRC1_POSZ": 1.0, "EK3_SRC1_VELZ": 3.0}
HOME = (-35.3632621, 149.1652374, 584.0)


def path_of(seed: int = 1) -> Floats:
    """Return a way through space: north, east, down in m."""
    time_s = 1e-6 * PERIOD_US * np.arange(COUNT)
    phases = np.random.default_rng(seed).uniform(0, 6, 3)
    return np.column_stack(
        [
            size * np.sin(rate * time_s + phase)
            for size, rate, phase in zip((6, 4, 2), (0.5, 0.7, 0.9), phases, strict=True)
        ]
    )


def found_for(sent_m: Floats, vehicle_m: Floats, **params: float) -> Mapping[str, Finding]:
    """Return what is found of positions if the vehicle was elsewhere."""
    messages = [pose(1 + n * PERIOD_US, x=x, y=y, z=z) for n, (x, y, z) in enumerate(sent_m.tolist())]
    made = evidence_of(stream_of(messages, PERIOD_US), {"EK3_SRC1_YAW": 1, **params})
    times = START_US + PERIOD_US * np.arange(0, COUNT, 5)
    position = PositionSeries("GPS_RAW_INT", times, vehicle_m[::5])
    return findings_of(changed(made, paths=compare_paths(made.stream.poses, position, (), made.trial.params)))


@pytest.mark.parametrize("scale", [0.8, 1.1, 1.5])
def test_scale_is_told_with_the_value_that_undoes_it(scale: float) -> None:
    noise = np.random.default_rng(2).normal(0, 0.03, (COUNT, 3))
    finding = found_for(path_of() / scale, path_of() + noise)["XN5-18"]
    assert finding.severity is Severity.WARNING
    assert "(GPS_RAW_INT)" in finding.evidence
    (value,) = [word for word in finding.fix.split() if word.endswith(",") and word[0].isdigit()]
    assert float(value[:-1]) == pytest.approx(scale, rel=0.02)


def test_scale_that_is_set_already_is_in_order() -> None:
    assert "XN5-18" not in found_for(path_of() / 1.3, path_of(), VISO_SCALE=1.3)
    assert "XN5-18" in found_for(path_of(), path_of(), VISO_SCALE=1.3)


def test_path_of_the_vehicle_itself_is_in_order() -> None:
    assert not {"XN5-18", "XN2-09"} & set(found_for(path_of(), path_of() + 100.0))


def test_vehicle_elsewhere_tells_nothing() -> None:
    assert not {"XN5-18", "XN2-09"} & set(found_for(path_of(1), path_of(7) * 0.5))


@pytest.mark.parametrize(("columns", "signs", "name"), [
    ((1, 0, 2), (1, 1, -1), "ENU"),
    ((0, 1, 2), (1, 1, -1), "NEU"),
    ((0, 1, 2), (-1, 1, 1), "SED"),
])  # fmt: skip
def test_axes_of_positions_are_told(columns: tuple[int, ...], signs: tuple[int, ...], name: str) -> None:
    finding = found_for(path_of()[:, columns] * signs, path_of())["XN2-09"]
    assert f"positions are {name} rather than NED" in finding.evidence


@pytest.mark.parametrize("params", [{"EK3_SRC1_YAW": 6}, {"VISO_TYPE": 2}])
def test_axes_are_left_open_where_the_heading_is_the_streams_own(params: dict[str, float]) -> None:
    assert "XN2-09" not in found_for(path_of()[:, (1, 0, 2)] * (1, 1, -1), path_of(), **params)


@pytest.mark.parametrize(("has_path", "moves", "is_judged"), [(True, 1, True), (True, 0, False), (False, 1, False)])
def test_axes_that_nothing_else_tells_are_not_judged(has_path: bool, moves: int, is_judged: bool) -> None:
    path = moves * path_of()
    times_us = START_US + PERIOD_US * np.arange(COUNT)
    codec = Codec(1, 197)
    frames = [codec.encode(pose(1 + n * PERIOD_US, x=x, y=y, z=z)) for n, (x, y, z) in enumerate(path.tolist())]
    messages = tuple(map(StreamMessage, times_us.tolist(), frames))
    stream = Stream("made", messages, {"VISO_TYPE": 1, "EK3_SRC1_YAW": 1})
    position = PositionSeries("GPS", times_us, path) if has_path else None
    evidence = gather(stream, vehicle=VehicleData(position=position), is_tried=False)
    assert any("are not judged" in note for note in evidence.notes) is not is_judged


@pytest.mark.parametrize(("changed", "expected"), [
    ({}, True),
    ({"EK3_SRC1_POSXY": 6.0}, False),
    ({"EK3_SRC1_VELXY": 6.0}, False),
    ({"EK3_SRC2_POSXY": 6.0}, False),
    ({"EK3_SRC1_POSZ": 6.0}, False),
])  # fmt: skip
def test_filter_that_takes_the_stream_proves_nothing(changed: dict[str, float], expected: bool) -> None:
    assert is_independent({**GPS, **changed}) is expected


def test_filter_of_unknown_sources_proves_nothing() -> None:
    assert not is_independent({})
    listener = PositionListener()
    for number in range(50):
        listener.take(number * 100_000, LOCAL_POSITION_NED(number, 1.0 * number, 0, 0, 0, 0, 0))
        listener.take(number * 100_000, GLOBAL_POSITION_INT(number, number, 0, 0, 0, 0, 0, 0, 0))
    assert listener.position({}) is None
    told = listener.position(GPS)
    assert told is not None
    assert told.origin == "GLOBAL_POSITION_INT"


def test_fixes_of_a_gps_count_whatever_the_filter_takes() -> None:
    codec, frames = Codec(1, 1), []
    said = [HEARTBEAT(2, 3, 81, 0, 3, 3), PARAM_VALUE("EK3_SRC1_POSXY", 6.0, 9, 900, 0)]
    for number in range(40):
        lat, lon = (int((HOME[axis] + 1e-5 * number) * 1e7) for axis in (0, 1))
        said.append(GPS_RAW_INT(0, 1 if number < 5 else 3, lat, lon, int(1e3 * (HOME[2] + number)), 0, 0, 0, 0, 9))
    for number, message in enumerate(said):
        frames.append(StreamMessage(1_000_000 + 200_000 * number, codec.encode(message)))
    told = listen(Stream("made", tuple(frames))).position
    assert told is not None
    assert (told.origin, len(told.time_us), int(told.time_us[0])) == ("GPS_RAW_INT", 35, 2_400_000)
    north, east = 1.1131884502145034, 1.1131884502145034 * math.cos(math.radians(HOME[0]))
    assert np.diff(told.ned_m, axis=0).mean(axis=0) == pytest.approx([north, east, -1.0], rel=2e-3)


def test_degrees_become_metres_as_in_the_firmware() -> None:
    ned_m = ned_of_degrees(np.array([[60.0, 10.0, 100.0], [60.001, 10.001, 90.0]]))
    assert ned_m[1] == pytest.approx([111.318845, 55.659422, 10.0], rel=1e-6)


class Columns:
    """Records of a log, in the way of ``LogColumns``."""

    def __init__(self, **kinds: dict[str, Any]) -> None:
        self._kinds = {kind: {label: np.array(column) for label, column in of.items()} for kind, of in kinds.items()}
        self.types = {kind: SimpleNamespace(labels=tuple(of)) for kind, of in self._kinds.items()}
        self.counts = {kind: len(next(iter(of.values()))) for kind, of in self._kinds.items()}

    def columns(self, kind: str, labels: list[str]) -> dict[str, Any]:
        return {label: self._kinds[kind][label] for label in labels}


def log_of(params: dict[str, float], **kinds: dict[str, Any]) -> Any:
    """Return a log with parameters and other records."""
    return Columns(PARM={"TimeUS": [0] * len(params), "Name": list(params), "Value": list(params.values())}, **kinds)


def told_by(sources: dict[str, float], **kinds: dict[str, Any]) -> tuple[str, int] | None:
    """Return what tells the vehicle's place, and how often, in a log."""
    told = position_in(log_of(sources, **kinds))
    return None if told is None else (told.origin, len(told.time_us))


def test_log_tells_truth_then_gps_then_a_filter_without_the_stream() -> None:
    places = {
        "TimeUS": 100_000 * np.arange(60),
        "Lat": 47 + 1e-5 * np.arange(60),
        "Lng": np.zeros(60),
        "Alt": np.zeros(60),
    }
    fixed, unfixed = {**places, "Status": [3] * 40 + [1] * 20}, {**places, "Status": [1] * 60}
    cores = {"TimeUS": places["TimeUS"], "C": np.arange(60) % 2}
    states = {**cores, **dict.fromkeys(("PN", "PE", "PD"), np.zeros(60))}
    flags = {**cores, "SS": np.where(np.arange(60) < 50, 0x1F, 0xA7)}
    sets = {**cores, "SS": np.arange(60) // 45}
    mixed = {**GPS, "EK3_SRC2_POSXY": 6.0}
    own = {**GPS, "EK3_SRC1_POSXY": 6.0}
    assert told_by(own, GPS=fixed, SIM=places) == ("SIM", 60)
    assert told_by(own, GPS=fixed, XKF1=states) == ("GPS", 40)
    assert told_by(GPS, GPS=unfixed, XKF1=states, XKF4=flags) == ("XKF1", 25)  # then it holds what it had
    assert told_by(mixed, XKF1=states, XKF4=flags, XKFS=sets) == ("XKF1", 23)  # then it takes the stream
    assert told_by(mixed, XKF1=states, XKF4=flags) is None
    assert told_by(GPS, POS=places) == ("POS", 60)
    assert told_by(own, XKF1=states, XKF4=flags, POS=places) is None
    assert told_by(GPS, GPS={"TimeUS": places["TimeUS"]}) is None  # of a firmware that logs others


def test_log_tells_heights_by_truth_then_the_primary_barometer_then_a_filter() -> None:
    time_us = 100_000 * np.arange(60)
    truth = {"TimeUS": time_us, "Alt": 584.0 + np.arange(60)}
    baro = {"TimeUS": time_us, "I": np.arange(60) % 2, "Alt": np.where(np.arange(60) % 2, 7.0, 3.0)}
    state = {"TimeUS": time_us, "C": np.zeros(60), "PD": -np.arange(60.0)}

    def told(params: dict[str, float], **kinds: dict[str, Any]) -> tuple[str, float] | None:
        level = level_in(log_of(params, **kinds))
        return None if level is None else (level.origin, float(level.down_m[0]))

    assert told(GPS, SIM=truth, BARO=baro) == ("SIM", -584.0)
    assert told(GPS, BARO=baro) == ("BARO", -3.0)
    assert told({**GPS, "BARO_PRIMARY": 1.0}, BARO=baro) == ("BARO", -7.0)
    assert told(GPS, XKF1=state) == ("XKF1", 0.0)
    assert told({**GPS, "EK3_SRC1_POSZ": 6.0}, XKF1=state) is None


@pytest.mark.parametrize(("vehicle_type", "is_told"), [(2, True), (12, False)])
def test_pressure_tells_heights_of_what_is_not_a_submarine(vehicle_type: int, is_told: bool) -> None:
    listener = PositionListener()
    listener.take(0, HEARTBEAT(vehicle_type, 3, 81, 0, 3, 3))
    for number in range(30):
        listener.take(number * 100_000, SCALED_PRESSURE(number, 1000.0 - 0.12 * number, 0.0, 0))
    level = listener.level({})
    assert (level is not None) == is_told
    if level is not None:
        assert level.down_m[-1] == pytest.approx(-29 * 0.12 / 1000 * 0.1903 * 44330, rel=0.01)


def test_poor_gps_counts_for_less() -> None:
    listener = PositionListener()
    for number in range(30):
        listener.take(
            number * 200_000, GPS_RAW_INT(0, 3, 470_000_000, 80_000_000 + number, 0, 0, 0, 0, 0, 9, h_acc=8000)
        )
    told = listener.position({})
    assert told is not None
    assert told.noise_m == 8.0


def test_source_that_was_the_stream_once_remains_so() -> None:
    assert sources_of([("EK3_SRC1_POSXY", 6.0), ("X", 6.0), ("EK3_SRC1_POSXY", 3.0), ("X", 1.0)]) == {
        "EK3_SRC1_POSXY": 6.0,
        "X": 1.0,
    }


def test_recorded_flight_by_external_navigation_proves_nothing() -> None:
    assert vehicle_of_log(RECORDED / "logs" / "flight_t265.BIN.xz").position is None


@pytest.fixture(scope="module")
def truth() -> PositionSeries:
    """Return the path of the recorded flight as if another sensor had seen it, from a time since boot on."""
    states = read_recorded_states(RECORDED / "logs" / "flight_t265.BIN.xz")
    noise = np.random.default_rng(3).normal(0, 0.02, states.pos_ned.shape)
    by_us = LEAD_US - 40_000_000
    return PositionSeries("GPS", np.asarray(states.pos_time_us, np.int64) + by_us, states.pos_ned + noise)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, 1.2])
def test_scale_of_a_recorded_flight_is_told(truth: PositionSeries, factor: float) -> None:
    stream = faulty(piece("flight_t265", 40.0, 20.0), f"{{kind: scale, factor: {factor}}}")
    _, findings = examine(stream, replace(shifted("flight_t265", 40.0), position=truth))
    assert codes(findings, Severity.WARNING) == ({"XN5-18"} if factor != 1 else set())
    fixes = [finding.fix for finding in findings if finding.code == "XN5-18"]
    assert [float(fix.split()[3].rstrip(",")) for fix in fixes] == [pytest.approx(1 / factor, rel=0.03) for _ in fixes]


@pytest.mark.parametrize("kind", ["ATT", "SIM"])
def test_times_that_damage_made_up_are_left_out(tmp_path: Path, kind: str) -> None:
    maker = LogMaker()
    layout = maker.define(kind, "TimeUS,Roll,Pitch,Yaw", "Qccc")
    for time_us in (1_000_000, 2**64 - 1, *range(2_000_000, 12_000_000, 40_000)):
        maker.add_to(layout, 0.0, TimeUS=time_us, Yaw=90.0)
    told = vehicle_of_log(maker.save(tmp_path / "damaged.BIN"))
    series = told.attitude if kind == "ATT" else told.truth
    assert series is not None
    assert series.time_us[:2].tolist() == [1_000_000, 2_000_000]
