# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter over the replay records of a log: what is fed to it, when, what is logged, and what cannot be used."""

import lzma
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_dtype import texts_of
from ap_core.log_structure import COMMON_STRUCTURES
from tests.ekf_replay import replay_ekf
from tests.places import RECORDED
from viso.errors import InputError
from viso.logs.logger import STRUCTURES
from viso.logs.recorded import read_columns
from viso.replay.ekf.player import EkfPlayer
from viso.replay.ekf.run import LABELS, EkfRun

Record = tuple[str, dict[str, Any]]
Change = Callable[[str, dict[str, Any], int], Iterable[Record]]

LOG = RECORDED / "logs" / "voxl.BIN.xz"
BY_NAME = {structure.name: structure for structure in STRUCTURES}
END_US = 5_250_000
LONG_ENOUGH = 400_000  # bytes
FILTERS = "EK3_", "INS_POS", "BARO", "COMPASS_", "GPS", "AHRS_", "VISO_", "LOG_"
INITIALISED_US, AIDING_US, YAW_US = 4_454_051, 5_089_630, 5_162_101


def read(path: Path) -> list[Record]:
    """Return all records that have a layout here, with their fields as they are stored."""
    log = read_columns(path)
    found = []
    for kind in log.counts.keys() & BY_NAME.keys():
        labels = log.types[kind].labels
        columns = [log.records(kind)[label] for label in labels]
        values = ((texts_of(one) if one.dtype.kind == "S" else one).tolist() for one in columns)
        for offset, *row in zip(log.offsets(kind).tolist(), *values, strict=True):
            found.append((offset, (kind, dict(zip(labels, row, strict=True)))))
    return [record for _, record in sorted(found, key=itemgetter(0))]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    """Return the beginning of a recorded log: the filter starts, aligns tilt, aids and aligns yaw."""
    path = tmp_path_factory.mktemp("recorded") / "voxl.BIN"
    path.write_bytes(lzma.decompress(LOG.read_bytes())[:LONG_ENOUGH])
    records = read(path)
    end = next(i for i, (name, fields) in enumerate(records) if name == "RFRH" and fields["TimeUS"] > END_US)
    return [record for record in records[:end] if matters(*record)]


def matters(name: str, fields: dict[str, Any]) -> bool:
    """Return whether a run looks at a record; of parameters there are more than a thousand more."""
    return fields["Name"].startswith(FILTERS) if name == "PARM" else name not in ("FMT", "FMTU", "UNIT", "MULT")


def unchanged(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
    yield name, fields


class Rig:
    """Runs the filter over changed copies of the recorded log."""

    def __init__(self, recorded: Sequence[Record], folder: Path) -> None:
        self._recorded = recorded
        self.path = folder / "short.BIN"
        self._out = folder / "out.BIN"

    def write(self, change: Change) -> None:
        writer, now_us = DataFlashWriter(STRUCTURES), 0
        data = bytearray().join(writer.start_up([], time_us=0))
        for record in self._recorded:
            now_us = record[1]["TimeUS"] if record[0] == "RFRH" else now_us
            for name, fields in change(*record, now_us):
                data += writer.record(BY_NAME[name], list(fields.values()))
        self.path.write_bytes(data)

    def run(self, change: Change = unchanged, until_s: float = math.inf) -> list[Record]:
        """Run over a changed copy; return what came of it."""
        self.write(change)
        return self.run_again(until_s)

    def run_again(self, until_s: float = math.inf) -> list[Record]:
        """Run over the copy that is there; return what came of it."""
        run = EkfRun(self.path, until_s=until_s)
        run.run()
        run.output.save(self._out)
        return read(self._out)

    def fails_with(self, problem: str, change: Change) -> bool:
        """Return whether a changed copy is refused with one line that names it and the problem."""
        with pytest.raises(InputError) as refused:
            self.run(change)
        assert str(refused.value) == f"{self.path}: {problem}"
        return True


@pytest.fixture(scope="module")
def ours(recorded: list[Record], tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    """Return what comes of the log as it is."""
    return Rig(recorded, tmp_path_factory.mktemp("ours")).run()


@pytest.fixture
def rig(recorded: list[Record], tmp_path: Path) -> Rig:
    return Rig(recorded, tmp_path)


def of(records: Iterable[Record], name: str) -> list[dict[str, Any]]:
    return [fields for found, fields in records if found == name]


def texts(records: Iterable[Record]) -> list[tuple[int, str]]:
    return [(fields["TimeUS"], fields["Message"]) for fields in of(records, "MSG")]


def params(**values: float) -> Change:
    """Return a change of parameters from the beginning on."""

    def change(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
        yield name, {**fields, "Value": values.get(fields["Name"], fields["Value"])} if name == "PARM" else fields

    return change


def after_frame(time_us: int, *extra: Record) -> Change:
    """Return a change that writes records between two frames, after that of a time."""
    waiting = list(extra)

    def change(name: str, fields: dict[str, Any], now_us: int) -> Iterator[Record]:
        yield name, fields
        if name == "RFRF" and now_us >= time_us and waiting:
            yield from waiting
            waiting.clear()

    return change


def without(*names: str) -> Change:
    def change(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
        if name not in names:
            yield name, fields

    return change


# What is logged


def test_texts_come_in_the_frames_of_the_log(ours: list[Record], recorded: list[Record]) -> None:
    of_first = [text for text in texts(ours) if "IMU0" in text[1]]
    assert of_first == [text for text in texts(recorded) if "EKF3 IMU0" in text[1]]
    assert {INITIALISED_US, AIDING_US, YAW_US} <= {time_us for time_us, _ in of_first}


def test_texts_are_those_of_every_core(ours: list[Record]) -> None:
    told = texts(ours)
    of_second = [(time_us, text.replace("IMU1", "IMU0")) for time_us, text in told if "IMU1" in text]
    assert of_second == [text for text in told if "IMU0" in text[1]]


def test_estimates_come_at_the_times_of_the_logs(ours: list[Record], recorded: list[Record]) -> None:
    for name in ("XKF1", "XKF2", "XKF3", "XKF4", "XKF5", "XKFS", "XKQ", "XKV1", "XKV2"):
        times_us = [fields["TimeUS"] for fields in of(ours, name) if fields["C"] == 0]
        assert times_us == [fields["TimeUS"] for fields in of(recorded, name) if fields["C"] == 0]


def test_estimates_before_the_filter_has_begun_are_the_logs(ours: list[Record], recorded: list[Record]) -> None:
    for name in ("XKF1", "XKF2", "XKF3", "XKF4", "XKF5", "XKFS", "XKQ", "XKV1", "XKV2"):
        before = [fields for fields in of(recorded, name) if fields["TimeUS"] < INITIALISED_US]
        assert before
        assert [fields for fields in of(ours, name) if fields["C"] == 0][: len(before)] == before


def test_estimates_come_in_the_order_of_the_logs(ours: list[Record], recorded: list[Record]) -> None:
    first = [name for name, fields in ours if name.startswith("XK") and fields["C"] == 0][:20]
    assert first == [name for name, fields in recorded if name.startswith("XK")][:20]


@pytest.mark.slow
def test_log_without_estimates_gets_them_ten_times_a_second(rig: Rig) -> None:
    ours = of(rig.run(without("XKF4", "XKF1", "XKF3")), "XKF4")
    times_us = [fields["TimeUS"] for fields in ours if fields["C"] == 0]
    assert len(times_us) >= (END_US - 3_500_000) // 102_500
    assert all(100_000 <= after - before < 102_500 for before, after in pairwise(times_us))


@pytest.mark.slow
def test_estimates_are_those_of_the_frame_whenever_in_it_they_are_logged(rig: Rig, ours: list[Record]) -> None:
    # The firmware writes RFRF, which tells that the filter ran, only after the estimates; or before, as it happens.
    def late(name: str, fields: dict[str, Any], now_us: int) -> Iterator[Record]:
        if name == "RFRF":
            yield name, {**fields, "FTypes": fields["FTypes"] & ~32}
            yield from waiting
            waiting.clear()
        elif name.startswith("XK"):
            waiting.append((name, fields))
        else:
            yield name, fields

    waiting: list[Record] = []
    assert rig.run(late) == ours


@pytest.mark.slow
def test_level_of_the_log_leaves_nothing_out(rig: Rig, ours: list[Record]) -> None:
    assert len(of(rig.run(params(EK3_LOG_LEVEL=1)), "XKF1")) == len(of(ours, "XKF1")) > 0


@pytest.mark.slow
@pytest.mark.parametrize(("mask", "cores"), [pytest.param(1, {0}, marks=pytest.mark.slow), (3, {0, 1})])
def test_every_core_of_the_mask_has_records(rig: Rig, mask: int, cores: set[int]) -> None:
    ours = rig.run(params(EK3_IMU_MASK=mask), until_s=4.6)
    assert {fields["C"] for fields in of(ours, "XKF4")} == cores
    assert [text for _, text in texts(ours)] == [f"EKF3 IMU{core} initialised" for core in sorted(cores)]


@pytest.mark.slow
def test_second_imu_alone_is_the_first_core(rig: Rig) -> None:
    def change(name: str, fields: dict[str, Any], now_us: int) -> Iterator[Record]:
        for found, changed in params(EK3_IMU_MASK=2)(name, fields, now_us):
            yield found, {**changed, "I": 1} if found == "RISI" else changed

    ours = rig.run(change, until_s=4.6)
    assert {fields["C"] for fields in of(ours, "XKF4")} == {0}
    assert [text for _, text in texts(ours)] == ["EKF3 IMU1 initialised"]


def test_parameters_are_the_logs_with_their_defaults(rig: Rig, recorded: list[Record]) -> None:
    ours = [(fields["Name"], fields["Value"], fields["Default"]) for fields in of(rig.run(until_s=4), "PARM")]
    assert ours == [(fields["Name"], fields["Value"], fields["Default"]) for fields in of(recorded, "PARM")]


def test_yaw_alignment_is_an_event_after_its_text(ours: list[Record]) -> None:
    told = [(name, fields) for name, fields in ours if name in ("MSG", "EV")]
    (place,) = (i for i, (name, _) in enumerate(told) if name == "EV")
    assert told[place][1] == {"TimeUS": YAW_US, "Id": 62}
    assert "yaw alignment complete" in told[place - 1][1]["Message"]


def test_times_never_run_backwards(ours: list[Record]) -> None:
    times_us = [fields["TimeUS"] for _, fields in ours if "TimeUS" in fields]
    assert times_us == sorted(times_us)


@pytest.mark.slow
def test_same_log_gives_the_same_bytes(rig: Rig, tmp_path: Path) -> None:
    rig.run(until_s=4.6)
    first = (tmp_path / "out.BIN").read_bytes()
    rig.run_again(until_s=4.6)
    assert (tmp_path / "out.BIN").read_bytes() == first


@pytest.mark.slow
def test_what_parameters_ask_for_in_vain_is_in_the_log(rig: Rig) -> None:
    ours = rig.run(params(EK3_SRC2_POSXY=4), until_s=3.5)
    assert "EK3_SRC2_POSXY is 4: range beacons are not fused here" in [text for _, text in texts(ours)]


# What is fed


@pytest.mark.slow
def test_parameter_that_changes_in_flight_counts_at_once(rig: Rig) -> None:
    ours = rig.run(after_frame(4_600_000, ("PARM", changed("EK3_SRC1_POSXY", 0.0))))
    assert not [text for _, text in texts(ours) if "external nav" in text]


def changed(name: str, value: float) -> dict[str, Any]:
    return {"TimeUS": 4_600_000, "Name": name, "Value": value, "Default": math.nan}


@pytest.mark.slow
def test_parameter_that_changes_in_flight_is_logged(rig: Rig) -> None:
    ours = rig.run(after_frame(4_600_000, ("PARM", changed("EK3_YAW_M_NSE", 0.25))))
    last = of(ours, "PARM")[-1]
    assert (last["Name"], last["Value"]) == ("EK3_YAW_M_NSE", 0.25)
    assert 4_600_000 <= last["TimeUS"] < 4_602_500


@pytest.mark.slow
def test_source_set_is_chosen_by_an_event(rig: Rig) -> None:
    ours = rig.run(after_frame(5_200_000, ("REV3", {"Event": 14})))
    assert [fields["Id"] for fields in of(ours, "EV")] == [62, 86]
    sets = [(fields["TimeUS"] > 5_200_000, fields["SS"]) for fields in of(ours, "XKFS")]
    assert set(sets) == {(False, 0), (True, 1)}


@pytest.mark.slow
def test_source_set_may_have_been_chosen_before_the_first_frame(rig: Rig) -> None:
    chosen = [("EV", {"TimeUS": 2_700_000, "Id": 86})]

    def change(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
        if name == "RFRH":
            yield from chosen
            chosen.clear()
        yield name, fields

    ours = rig.run(change, until_s=4.6)
    assert {fields["SS"] for fields in of(ours, "XKFS") if fields["TimeUS"] > INITIALISED_US} == {1}


@pytest.mark.slow
def test_change_of_the_primary_core_is_logged(rig: Rig) -> None:
    wishes = [("PARM", changed(f"EK3_{name}", value)) for name, value in (("OPTIONS", 2.0), ("PRIMARY", 1.0))]
    ours = rig.run(after_frame(4_600_000, *wishes), until_s=5.0)
    now_us = 4_604_000
    assert [text for time_us, text in texts(ours) if abs(time_us - now_us) < 2500] == [
        "EKF3 lane switch 1",
        "EKF primary changed:1",
    ]
    assert [(fields["Subsys"], fields["ECode"]) for fields in of(ours, "ERR")] == [(24, 1)]
    assert 62 in {fields["Id"] for fields in of(ours, "EV")}
    changes = [(fields["TimeUS"] > now_us, fields["PI"]) for fields in of(ours, "XKF4")]
    assert set(changes) == {(False, 0), (True, 1)}
    assert {(fields["TimeUS"] > now_us, fields["C"]) for fields in of(ours, "XKF5")} == {(False, 0), (True, 1)}


@pytest.mark.slow
def test_core_that_is_the_primary_one_from_the_beginning_is_logged_as_a_change(rig: Rig) -> None:
    def change(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
        yield name, {**fields, "Value": 1.0} if fields.get("Name") == "EK3_PRIMARY" else fields

    ours = rig.run(change, until_s=4.6)
    ((time_us, text),) = [said for said in texts(ours) if "EKF primary" in said[1]]
    assert text == "EKF primary changed:1"
    assert time_us == pytest.approx(INITIALISED_US, abs=2500)
    assert [(fields["Subsys"], fields["ECode"]) for fields in of(ours, "ERR")] == [(24, 1)]


@pytest.mark.slow
def test_core_is_run_with_its_own_imu(rig: Rig) -> None:
    def change(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
        yield name, fields
        if name == "RISI":
            yield name, {**fields, "DVX": fields["DVX"] + 0.0025, "I": 1}

    ours = rig.run(change, until_s=4.8)
    pitches = [[fields["Pitch"] for fields in of(ours, "XKF1") if fields["C"] == core][-1] for core in (0, 1)]
    assert pitches[1] - pitches[0] == pytest.approx(585, abs=30)  # asin(1 / 9.8), in hundredths of a degree


@pytest.mark.slow
def test_core_that_was_late_is_late_again(rig: Rig) -> None:
    def change(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
        yield name, {**fields, "Slow": 1 << 4 + 1} if name == "RFRF" else fields

    ours = of(rig.run(change), "XKTV")
    times_us = [[fields["TimeUS"] for fields in ours if fields["C"] == core] for core in (0, 1)]
    assert times_us[0] != times_us[1]
    assert {round(time_us - times_us[1][0]) // 2499 % 9 for time_us in times_us[1]} == {0}


@pytest.mark.slow
def test_core_may_be_run_alone(rig: Rig) -> None:
    rig.write(unchanged)
    run = EkfRun(rig.path, until_s=4.6, core=1)
    run.run()
    assert run.imus == {1: 1}
    with pytest.raises(InputError, match=r"short\.BIN: no core 2; the log has 0, 1 \(at 3\.454 s\)\Z"):
        EkfRun(rig.path, core=2).run()


@pytest.mark.slow
def test_origin_is_logged_once(rig: Rig) -> None:
    place = {"Lat": -353632610 & 0xFFFFFFFF, "Lon": 1491652300, "Alt": 58400}
    ours = rig.run(after_frame(4_600_000, ("RSO3", place), ("RSO3", {**place, "Alt": 1})))
    assert [tuple(fields.values())[1:] for fields in of(ours, "ORGN")] == [(0, -353632610, 1491652300, 58400)]
    assert of(ours, "XKF1")[-1]["OH"] == 58400
    assert [text for _, text in texts(ours)].count("EKF3 IMU0 origin set") == 1


def odometry(time_ms: int, forward_m: float) -> Record:
    fields = dict.fromkeys(BY_NAME["RBOH"].fields, 0.0)
    return "RBOH", {**fields, "Q": 90.0, "DPX": forward_m, "DT": 0.04, "TS": time_ms, "D": 0}


@pytest.mark.slow
def test_body_odometry_reaches_the_filter(rig: Rig) -> None:
    moving = rig.run(after_frame(5_100_000, odometry(5_100, 0.4)))
    assert [fields["IX"] for fields in of(moving, "XKFD")] == pytest.approx([-10], abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("delay_ms", "known_us"), [pytest.param(0, 5_249_566, marks=pytest.mark.slow), (60, 5_149_606)]
)
def test_odometry_is_as_late_as_the_camera(rig: Rig, delay_ms: int, known_us: int) -> None:
    # Its own record tells no delay; the one of the camera does.
    extra = after_frame(5_100_000, odometry(5_100, 0.4))

    def change(name: str, fields: dict[str, Any], now_us: int) -> Iterator[Record]:
        yield from extra(name, {**fields, "Del": delay_ms} if name == "RVOH" else fields, now_us)

    assert [fields["TimeUS"] for fields in of(rig.run(change), "XKFD")] == [known_us]


@pytest.mark.slow
def test_camera_off_the_imu_is_allowed_for(rig: Rig, ours: list[Record]) -> None:
    def change(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
        yield name, {**fields, "OX": -2.0} if name == "RVOH" else fields

    starts = [next(text for _, text in texts(run) if "initial pos" in text) for run in (ours, rig.run(change))]
    assert starts == [f"EKF3 IMU0 initial pos NED = {north_m},-0.0,0.0 (m)" for north_m in (0.0, 2.0)]


@pytest.mark.slow
def test_place_of_the_imu_counts_against_that_of_the_camera(rig: Rig) -> None:
    started = [text for _, text in texts(rig.run(params(INS_POS1_X=2.0))) if "IMU0 initial pos" in text]
    assert started == ["EKF3 IMU0 initial pos NED = 2.0,-0.0,0.0 (m)"]


# What is compared


@pytest.mark.slow
def test_comparison_has_what_the_log_says(rig: Rig, recorded: list[Record]) -> None:
    rig.write(unchanged)
    replay = replay_ekf(rig.path)
    theirs = [fields for fields in of(recorded, "XKF4") if fields["FS"] != 128]
    assert list(np.round(1e6 * replay.time_s)) == [fields["TimeUS"] for fields in theirs]
    assert list(replay.recorded["SS"]) == [fields["SS"] for fields in theirs]
    assert set(replay.ours) == set(replay.recorded) == set(LABELS)


@pytest.mark.slow
def test_comparison_may_end_early(rig: Rig) -> None:
    rig.write(unchanged)
    whole = replay_ekf(rig.path)
    part = whole.until(5.1)
    assert part.time_s[-1] <= 5.1 < whole.time_s[-1]
    assert len(part.ours["PN"]) == len(part.recorded["PN"]) == len(part.time_s) < len(whole.time_s)
    assert [text for _, text in part.our_texts] == [text for time_s, text in whole.our_texts if time_s <= 5.1]
    assert part.our_texts == part.recorded_texts != whole.recorded_texts


@pytest.mark.slow
def test_run_may_end_early(rig: Rig) -> None:
    ours = rig.run(until_s=4.5)
    assert max(fields["TimeUS"] for _, fields in ours if "TimeUS" in fields) <= 4_500_000
    assert [text for _, text in texts(ours)] == ["EKF3 IMU0 initialised", "EKF3 IMU1 initialised"]


@pytest.mark.slow
def test_nothing_to_compare_is_one_line(rig: Rig) -> None:
    rig.write(without("XKF4"))
    with pytest.raises(InputError, match=r"short\.BIN: no XKF records to compare with\Z"):
        replay_ekf(rig.path, until_s=4.6)
    rig.write(unchanged)
    with pytest.raises(InputError, match=r"short\.BIN: no XKF records to compare with\Z"):
        replay_ekf(rig.path, until_s=4.4)  # before the filter has begun


# What cannot be used


def spoilt(kind: str, at_us: int, **values: object) -> Change:
    """Return a change of the first record of a kind from a time on."""
    done: list[bool] = []

    def change(name: str, fields: dict[str, Any], now_us: int) -> Iterator[Record]:
        spoils = name == kind and now_us >= at_us and not done
        done.extend([True] * spoils)
        yield name, {**fields, **values} if spoils else fields

    return change


@pytest.mark.slow
@pytest.mark.parametrize(("value", "shown"), [(math.nan, "nan"), pytest.param(math.inf, "inf", marks=pytest.mark.slow)])
def test_inertial_data_that_are_no_number_are_named(rig: Rig, value: float, shown: str) -> None:
    assert rig.fails_with(f"RISI.DAY is {shown} (at 4.602 s)", spoilt("RISI", 4_600_000, DAY=value))


def test_time_that_runs_backwards_is_named(rig: Rig) -> None:
    def change(name: str, fields: dict[str, Any], now_us: int) -> Iterator[Record]:
        yield name, {**fields, "TimeUS": 4_000_000} if name == "RFRH" and now_us == INITIALISED_US else fields

    assert rig.fails_with("RFRH.TimeUS runs backwards, from 4451552 to 4000000 (at 4.452 s)", change)


@pytest.mark.parametrize(
    "missing",
    ["EK3_IMU_MASK", *(pytest.param(name, marks=pytest.mark.slow) for name in ("EK3_SRC1_POSXY", "EK3_VELNE_M_NSE"))],
)
def test_missing_parameter_is_named(rig: Rig, missing: str) -> None:
    def change(name: str, fields: dict[str, Any], _now_us: int) -> Iterator[Record]:
        if fields.get("Name") != missing:
            yield name, fields

    with pytest.raises(InputError, match=rf"short\.BIN: no PARM record of {missing} \(at \d\.\d{{3}} s\)\Z"):
        rig.run(change)


def test_parameter_that_is_no_number_is_named(rig: Rig) -> None:
    assert rig.fails_with("PARM.Value is nan (at 0.000 s)", params(EK3_YAW_M_NSE=math.nan))


def test_mask_without_an_imu_is_named(rig: Rig) -> None:
    assert rig.fails_with("EK3_IMU_MASK selects no IMU (at 3.454 s)", params(EK3_IMU_MASK=0))


@pytest.mark.parametrize("lacking", [("RFRF",), ("RISI",), ("RFRH", "RISI", "RFRF", "REPH", "REVH", "RVOH")])
def test_log_without_replay_records_says_so(rig: Rig, lacking: tuple[str, ...]) -> None:
    assert rig.fails_with("no replay records; LOG_REPLAY was off, or the EKF was", without(*lacking))


def test_log_of_an_old_release_lacks_replay_records_and_not_a_field(tmp_path: Path) -> None:
    """Copter 3.6: an XKF1 for each core, which has no C."""
    writer, path = DataFlashWriter(COMMON_STRUCTURES), tmp_path / "old.BIN"
    xkf1 = writer.define("XKF1", "TimeUS,PN,PE,PD", "Qfff")
    path.write_bytes(b"".join(writer.start_up([], time_us=0)) + writer.record(xkf1, (1000, 1.0, 2.0, 3.0)))
    with pytest.raises(InputError, match=r"old\.BIN: no replay records; LOG_REPLAY was off, or the EKF was\Z"):
        EkfRun(path).run()


def test_mistake_of_ours_is_not_blamed_on_the_log(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_self: EkfPlayer, _record: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(EkfPlayer, "take", fail)
    with pytest.raises(ZeroDivisionError):
        rig.run()
