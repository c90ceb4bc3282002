# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso landmarks``: its demonstration, files of every kind, what it leaves behind, and what it refuses."""

import csv
import json
import math
import re
import shlex
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from tests.places import ROOT
from tests.unit.viso.command_line import Outcome, Viso, failed_with
from viso.commands import landmarks as landmarks_command
from viso.landmarks.camera import KEYS
from viso.landmarks.live import Live
from viso.landmarks.local_frame import FrameMode
from viso.landmarks.recordings import Merged
from viso.landmarks.run import Run
from viso.landmarks.scene import Scene
from viso.landmarks.synthetic import LANDMARKS, Planted, SyntheticFlight
from viso.landmarks.types import (
    AircraftReport,
    Camera,
    Detection,
    Detections,
    Event,
    GlobalFix,
    Landmark,
    LandmarkMap,
    VehiclePose,
)

PAGE = ROOT / "docs" / "landmarks.md"
EPOCH_S = 1_760_000_000.0
YAW_DEG = 3.1
SHORT = ("--demo", "--until", "6", "--frame", "spherical")


def record_of(event: Event) -> dict[str, Any]:
    """Return an event as the JSON that the command reads."""
    match event:
        case LandmarkMap():
            return {"landmarks": [{"id": one.id, "x": one.x_m, "y": one.y_m} for one in event.landmarks]}
        case Detections():
            seen = [{"id": one.id, "u": one.u_px, "v": one.v_px} for one in event.landmarks]
            above = [{"icao": one.id, "u": one.u_px, "v": one.v_px} for one in event.aircraft]
            return {"t_s": event.t_s, "observations": seen, "aircraft_observations": above}
        case VehiclePose():
            return {"t_s": event.t_s, "pose": {"x": event.x_m, "y": event.y_m, "z": event.z_m, "yaw": event.yaw_rad}}
        case GlobalFix():
            at = event.point
            return {"t_s": event.t_s, "fix": {"lat": at.latitude_deg, "lon": at.longitude_deg, "alt_m": at.alt_m}}
        case AircraftReport():
            names = {"latitude": event.latitude_deg, "longitude": event.longitude_deg, "altitude": event.altitude_ft}
            motion = {"speed": event.speed_kt, "heading": event.heading_deg}
            return {"t_s": event.t_s, "aircraft": [{"icao": event.icao, **names, **motion}]}
    raise AssertionError(event)


def written(path: str, events: Iterable[Event], offset_s: float = 0.0) -> Path:
    """Write events as JSON lines, later by an offset."""
    rows = [record_of(event) for event in events]
    for row in rows:
        row["t_s"] = row.get("t_s", 0.0) + offset_s
    file = Path(path)
    file.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    return file


def flight(duration_s: float = 6.0, **changes: Any) -> list[Event]:
    planted = Planted(math.radians(YAW_DEG))
    made = SyntheticFlight(planted=planted, duration_s=duration_s, mode=FrameMode.SPHERICAL, **changes)
    return list(made.events())


def figures(outcome: Outcome) -> dict[str, Any]:
    assert outcome.code == 0, outcome.err
    summary = json.loads(outcome.out.splitlines()[-1])["summary"]
    assert isinstance(summary, dict)
    return summary


def innovations(outcome: Outcome) -> list[dict[str, Any]]:
    rows = [json.loads(line) for line in outcome.out.splitlines()[:-1]]
    return [one for row in rows for one in row["innovations"] + row["aircraft"]]


@pytest.mark.parametrize(
    ("args", "least", "scenes"),
    [(("--until", "2"), 50, 11), pytest.param((), 1500, 301, marks=pytest.mark.slow)],
)
def test_demo_without_noise_has_innovations_of_exactly_zero(
    viso: Viso, args: tuple[str, ...], least: int, scenes: int
) -> None:
    offset = "--set", "offset_forward_m=0.5", "--set", "offset_left_m=-0.3"
    outcome = viso("landmarks", "--demo", "--json", *offset, *args)
    found = innovations(outcome)
    assert len(found) > least
    assert {(one["du_px"], one["dv_px"]) for one in found} == {(0.0, 0.0)}
    assert figures(outcome)["scenes"] == scenes
    assert outcome.err == ""


@pytest.mark.slow
def test_demo_tells_the_planted_errors(viso: Viso) -> None:
    args = ["--demo-noise-px", "1", "--demo-wrong", "0.1", "--demo-yaw-deg", YAW_DEG, "--demo-pitch-deg", "-1.5"]
    outcome = viso("landmarks", "--demo", "--json", *args, "--demo-delay-ms", "120", "--seed", "5", "--until", "30")
    fit = figures(outcome)["fit"]
    assert fit["yaw_offset_deg"] == pytest.approx(YAW_DEG, abs=0.2)
    assert fit["pitch_trim_deg"] == pytest.approx(-1.5, abs=0.1)
    assert fit["delay_ms"] == pytest.approx(120, abs=20)
    assert fit["rejected"] > 30


def test_people_are_told_in_sentences(viso: Viso) -> None:
    outcome = viso("landmarks", *SHORT, "--demo-noise-px", "1", "--demo-yaw-deg", "-3", "--demo-delay-ms", "90")
    assert outcome.code == 0
    assert re.search(
        r"heading: your heading is off by [23]\.\d+ \+- 0\.\d+ deg: the true one is right of it", outcome.out
    )
    assert re.search(r"mounting: right, within 0\.\d+ deg", outcome.out)
    assert re.search(r"time: the stamps of the pictures are \d+(\.\d)? \+- \d+(\.\d)? ms late", outcome.out)
    assert "31 pictures" in outcome.out or "30 pictures" in outcome.out


@pytest.mark.slow
def test_same_seed_gives_the_same_output(viso: Viso) -> None:
    args = ("landmarks", *SHORT, "--until", "2", "--json", "--demo-noise-px", "2", "--seed")
    assert viso(*args, "3") == viso(*args, "3") != viso(*args, "4")


@pytest.mark.slow
def test_lines_of_a_file_give_what_the_flight_gave(viso: Viso) -> None:
    written("flight.jsonl", flight())
    by_file = viso("landmarks", "flight.jsonl", "--json", "--frame", "spherical")
    by_demo = viso("landmarks", *SHORT, "--json", "--demo-yaw-deg", YAW_DEG)
    for one, other in zip(innovations(by_file), innovations(by_demo), strict=True):
        assert one == pytest.approx(other)


@pytest.mark.slow
def test_several_files_are_merged_by_time(viso: Viso) -> None:
    events = flight()
    written("all.jsonl", events)
    for name, kinds in (("poses", VehiclePose), ("seen", Detections), ("map", LandmarkMap)):
        written(f"{name}.jsonl", [event for event in events if isinstance(event, kinds)])
    written("rest.jsonl", [event for event in events if isinstance(event, AircraftReport | GlobalFix)])
    together = viso("landmarks", "all.jsonl", "--json", "--frame", "spherical")
    args = ("seen.jsonl", "rest.jsonl", "map.jsonl", "poses.jsonl", "--json", "--frame", "spherical")
    assert len(innovations(viso("landmarks", *args))) == len(innovations(together)) > 150


@pytest.mark.slow
def test_standard_input_is_a_file_among_others(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    events = flight()
    written("map.jsonl", events[:1])
    written("rest.jsonl", events[1:])
    whole = innovations(viso("landmarks", "map.jsonl", "rest.jsonl", "--json", "--frame", "spherical"))
    with Path("rest.jsonl").open() as piped:
        monkeypatch.setattr(sys, "stdin", piped)
        outcome = viso("landmarks", "map.jsonl", "-", "--json", "--frame", "spherical")
    assert innovations(outcome) == whole


def test_last_line_without_an_end_counts(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    file = written("flight.jsonl", flight(1.0))
    file.write_text(file.read_text().rstrip("\n"))
    for args in ([], ["--follow"]):
        with file.open() as piped:
            monkeypatch.setattr(sys, "stdin", piped)
            told = figures(viso("landmarks", "-", "--json", "--frame", "spherical", *args))
        assert told["landmark"]["pictures"] == 6


def test_follow_tells_a_line_a_second_and_ends_with_its_input(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    file = written("flight.jsonl", flight(3.0))
    with file.open() as piped:
        monkeypatch.setattr(sys, "stdin", piped)
        outcome = viso("landmarks", "-", "--follow", "--frame", "spherical")
    lines = [line for line in outcome.out.splitlines() if "[odom]" in line]
    assert [line.partition(" s ")[0] for line in lines] == ["0.00", "1.00", "2.00", "3.00"]
    assert "5 landmarks, +5" in lines[0]
    assert "your heading is off by 3.1" in outcome.out


@pytest.mark.parametrize("follow", [True, False])
def test_rows_are_there_as_they_come_only_if_they_come_once(
    viso: Viso, monkeypatch: pytest.MonkeyPatch, follow: bool
) -> None:
    file = written("flight.jsonl", flight(1.0))
    Path("out.csv").write_text("before")
    take, sizes = Run.take, []

    def watched(run: Run, event: Event) -> None:
        take(run, event)
        sizes.append(Path("out.csv").read_text().count("\n"))

    monkeypatch.setattr(Run, "take", watched)
    with file.open() as piped:
        monkeypatch.setattr(sys, "stdin", piped)
        args = "landmarks", "-", "--frame", "spherical", "--csv", "out.csv", *["--follow"] * follow
        assert viso(*args).code == 0
    assert len(set(sizes)) == (7 if follow else 1)
    assert len(Path("out.csv").read_text().splitlines()) == 43
    assert Path("out.csv~").exists() == follow


def test_base_station_lines_and_time_of_day_go_together(viso: Viso) -> None:
    events = [event for event in flight(2.0) if not isinstance(event, AircraftReport)]
    written("flight.jsonl", events, EPOCH_S)
    line = "MSG,3,1,1,3C6481,1,{0},{0},,4000,,,47.4200,8.5800,,,0,0,0,0\n"
    Path("adsb.sbs").write_text("".join(line.format(f"2025/10/09,08:53:2{second}.000") for second in range(3)))
    told = viso("landmarks", "flight.jsonl", "adsb.sbs", "--json", "--frame", "spherical", "--records", "out.jsonl")
    assert figures(told)["dropped"] == {}
    records = [json.loads(text) for text in Path("out.jsonl").read_text().splitlines()]
    assert {one["icao"] for record in records for one in record["aircraft"]} == {"3C6481"}


def test_csv_has_a_row_an_innovation(viso: Viso) -> None:
    outcome = viso("landmarks", *SHORT, "--until", "2", "--json", "--demo-noise-px", "1", "--csv", "out.csv")
    with Path("out.csv").open() as file:
        rows = list(csv.DictReader(file))
    told = innovations(outcome)
    assert sorted((row["id"], float(row["du_px"])) for row in rows) == sorted((one["id"], one["du_px"]) for one in told)
    assert {row["kind"] for row in rows} == {"landmark", "aircraft"}
    for row in rows:
        assert float(row["observed_u_px"]) - float(row["predicted_u_px"]) == pytest.approx(float(row["du_px"]))


@pytest.mark.slow
def test_records_are_read_again(viso: Viso) -> None:
    assert viso("landmarks", *SHORT, "--estimate", "--records", "out.jsonl").code == 0
    rows = [json.loads(line) for line in Path("out.jsonl").read_text().splitlines()]
    vectors, estimates = [row for row in rows if "header" in row], [row for row in rows if "kf_lat" in row]
    assert len(vectors) == 31
    assert [row["t_s"] for row in estimates] == [5.0]
    assert vectors[0]["header"]["frame_id"] == "local_enu"
    assert viso("landmarks", "out.jsonl", "--frame", "spherical").err == ""


@pytest.mark.slow
def test_estimate_warns_and_predicts_only_when_asked_to(viso: Viso) -> None:
    plain = viso("landmarks", *SHORT, "--json", "--estimate")
    chosen = viso("landmarks", *SHORT, "--json", "--estimate", "--predict-from", "estimated")
    for outcome in (plain, chosen):
        assert "must never reach the autopilot" in outcome.err
        assert figures(outcome)["estimate"]["aircraft_used"] >= 4
    poses = [{json.loads(line)["pose"] for line in outcome.out.splitlines()[:-1]} for outcome in (plain, chosen)]
    assert poses == [{"odom"}, {"odom", "estimated"}]


@pytest.mark.slow
def test_plot_is_the_last_picture(viso: Viso) -> None:
    outcome = viso("landmarks", *SHORT, "--until", "1", "--plot", "out.png", "--all-sky", "--palette", "classic")
    assert outcome.out.splitlines()[-1] == "plot: out.png"
    assert Path("out.png").read_bytes()[16:24] == (1600).to_bytes(4, "big") + (800).to_bytes(4, "big")


def test_frames_are_five_a_second(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    written("fast.jsonl", [*flight(0.0)[:1], *[VehiclePose(0.1 * index, 0.0, 0.0, 0.5) for index in range(21)]])
    drawn: list[float] = []

    def draw(scene: Scene) -> bytes:
        drawn.append(scene.t_s)
        return b"png"

    monkeypatch.setattr(landmarks_command, "_draw", lambda *_args, **_kwargs: draw)
    assert viso("landmarks", "fast.jsonl", "--frames", "video/frames").code == 0
    assert drawn == pytest.approx([1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
    assert [path.name for path in sorted(Path("video/frames").iterdir())][::5] == [
        "frame_000001.png",
        "frame_000006.png",
    ]


def test_camera_file_and_single_settings_make_the_camera(viso: Viso) -> None:
    Path("camera.toml").write_text(
        "width_px = 640\nheight_px = 480\nfx_px = 500\nfy_px = 500\ncx_px = 320\ncy_px = 240\n"
    )
    written("flight.jsonl", flight(1.0))
    args = ("landmarks", "flight.jsonl", "--json", "--frame", "spherical", "--camera", "camera.toml")
    one = innovations(viso(*args))[0]
    other = innovations(viso(*args, "--set", "cx_px=330", "--set", "pitch_trim_deg=1"))[0]
    assert other["predicted_u_px"] - one["predicted_u_px"] == pytest.approx(10, abs=5)
    assert other["predicted_v_px"] - one["predicted_v_px"] == pytest.approx(500 * math.radians(1), rel=0.3)


def test_camera_record_of_a_file_is_kept_unless_it_is_not_calibrated(viso: Viso) -> None:
    written("flight.jsonl", flight(1.0))
    record = {"K": [500, 0, 320, 0, 500, 240, 0, 0, 1], "width": 640, "height": 480}
    Path("good.json").write_text(json.dumps(record, indent=1))
    Path("zero.json").write_text(json.dumps({**record, "K": [0] * 9}))
    args = ("landmarks", "flight.jsonl", "--json", "--frame", "spherical")
    plain, good, zero = (
        innovations(viso(*args, *more))[0]["predicted_u_px"]
        for more in ([], ["--camera", "good.json"], ["--camera", "zero.json"])
    )
    assert zero == plain
    assert good - 320 == pytest.approx((plain - 640) / 2)


def test_what_was_left_out_is_noted(viso: Viso) -> None:
    file = written("flight.jsonl", flight(1.0))
    file.write_text(file.read_text() + 'x\n{"t_s": 9, "observations": []}\n')
    outcome = viso("landmarks", "flight.jsonl", "--frame", "spherical")
    assert outcome.code == 0
    assert outcome.err.splitlines() == [
        "note: flight.jsonl: 1 left out: not JSON",
        "note: 1 left out: a picture without a pose of its time",
    ]


def test_what_has_no_innovation_is_told(viso: Viso) -> None:
    events = flight(0.0)
    pose = next(event for event in events if isinstance(event, VehiclePose))
    seen = Detections(0.0, tuple(Detection(name, 1.0, 2.0) for name in ("0", "0", "17", "behind")))
    known = LandmarkMap(0.0, (*LANDMARKS, Landmark("behind", -50.0, 0.0)))
    written("odd.jsonl", [known, pose, seen])
    outcome = viso("landmarks", "odd.jsonl")
    assert outcome.code == 0
    assert "landmark: seen, but not known: 17 (1 times)" in outcome.out
    assert "landmark: seen, but not ahead of the camera, or of unknown height: behind (1 times)" in outcome.out
    assert "landmark: seen twice in a picture; the first counts: 0 (1 times)" in outcome.out


@pytest.mark.slow
def test_errors_of_the_other_sign_are_told_so(viso: Viso) -> None:
    args = ("--demo-pitch-deg", "1", "--demo-delay-ms", "-80", "--demo-noise-px", "1")
    outcome = viso("landmarks", *SHORT, *args)
    assert re.search(r"the camera looks 1\.\d+ \+- 0\.\d+ deg higher than believed", outcome.out)
    assert re.search(r"the stamps of the pictures are [78]\d(\.\d)? \+- \d+(\.\d)? ms early", outcome.out)


def test_standing_vehicle_tells_no_delay(viso: Viso) -> None:
    seen = next(event for event in flight(0.0) if isinstance(event, Detections))
    poses = [VehiclePose(index / 10, 0.0, 0.0, 0.4, 3.0) for index in range(41)]
    pictures = [Detections(index / 10 + 0.01, seen.landmarks) for index in range(10, 30)]
    written("map.jsonl", flight(0.0)[:1])
    written("poses.jsonl", poses)
    written("seen.jsonl", pictures)
    outcome = viso("landmarks", "map.jsonl", "poses.jsonl", "seen.jsonl")
    assert "time: the data do not tell: a vehicle that stands still shows no delay" in outcome.out
    assert "heading: your heading is off by" in outcome.out


def test_input_without_observations_says_that_there_is_no_fit(viso: Viso) -> None:
    written("poses.jsonl", [VehiclePose(index / 10, 0.0, 0.0, 0.5) for index in range(30)])
    outcome = viso("landmarks", "poses.jsonl")
    assert outcome.code == 0
    assert "no fit: 0 observations" in outcome.out


def test_plot_without_poses_is_noted(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(landmarks_command, "_draw", lambda *_args, **_kwargs: lambda _scene: b"png")
    written("map.jsonl", flight(0.0)[:1])
    outcome = viso("landmarks", "map.jsonl", "--plot", "out.png")
    assert outcome.code == 0
    assert "note: out.png is not written" in outcome.err
    assert not Path("out.png").exists()


def test_missing_geodesy_is_one_line(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymap3d", None)
    line = "the frame wgs84 needs pymap3d: pip install 'ardupilot-viso[landmarks]'; --frame spherical works without"
    assert failed_with(viso("landmarks", "--demo"), line)
    assert viso("landmarks", *SHORT, "--until", "1").code == 0


def test_missing_matplotlib_is_a_hint(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "viso.landmarks.picture", raising=False)
    for name in ["matplotlib", *(name for name in sys.modules if name.startswith("matplotlib."))]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delattr("viso.landmarks.picture", raising=False)
    outcome = viso("landmarks", *SHORT, "--until", "1", "--plot", "out.png")
    assert (outcome.code, Path("out.png").exists()) == (0, False)
    assert outcome.err == "no pictures: matplotlib is missing; install it with: pip install 'ardupilot-viso[plot]'\n"


@pytest.mark.parametrize(
    ("args", "line"),
    [
        ([], "nothing to read: name inputs, or --demo"),
        (["--demo", "a.jsonl"], "--demo takes no inputs"),
        (["-", "-"], "-: standard input can be read only once"),
        (["--demo", "--demo-noise-px", "-1"], "--demo-noise-px -1: not between 0 and 10000"),
        (["--demo", "--demo-wrong", "nan"], "--demo-wrong nan: not between 0 and 1"),
        (["--demo", "--extent", "0"], "--extent 0: not between 1 and 1e+06"),
        (
            ["--demo", "--reference", "1,2"],
            "--reference 1,2: not LATITUDE,LONGITUDE,ALTITUDE in degrees and metres",
        ),
        (
            ["--demo", "--reference", "91,2,0"],
            "--reference 91,2,0: not LATITUDE,LONGITUDE,ALTITUDE in degrees and metres",
        ),
        (["--demo", "--set", "fx_px=0"], "camera: fx_px: 0.0, not above 0"),
        (["--demo", "--set", "fx_px=nan"], "camera: fx_px: nan"),
        (["--demo", "--set", "width_px=1.5"], "--set width_px=1.5: not a number"),
        (["--demo", "--plot", "no/out.png"], "no/out.png: No such file or directory"),
        (["none.jsonl"], "none.jsonl: No such file or directory"),
        (["none.jsonl", "--follow"], "none.jsonl: No such file or directory"),
        (["none.BIN"], "none.BIN: No such file or directory"),
    ],
)
def test_what_cannot_be_used_is_one_line(viso: Viso, args: list[str], line: str) -> None:
    assert failed_with(viso("landmarks", *args), line)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("fx_px = 'a'\n", "camera.toml: fx_px: not a number"),
        ("fx = 5\n", "camera.toml: unknown key fx; there are width_px, "),
        ("fx_px 5\n", "camera.toml: not TOML: "),
        ("fx_px = " + "[" * 5000, "camera.toml: nested too deeply"),
        ("{" + '"K":[' * 5000, "camera.toml: "),
        ('{"K": [1, 2]}', "camera.toml: K is no list of 9 numbers"),
        ('{"width": 2}', "camera.toml: no known record"),
        ("{", "camera.toml: "),
    ],
)
def test_bad_camera_file_is_one_line(viso: Viso, text: str, line: str) -> None:
    Path("camera.toml").write_text(text)
    outcome = viso("landmarks", "--demo", "--camera", "camera.toml")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith(f"viso: {line}")
    assert outcome.err.count("\n") == 1


def test_unknown_setting_names_those_there_are(viso: Viso) -> None:
    outcome = viso("landmarks", "--demo", "--set", "zoom=2")
    assert outcome.code == 2
    assert outcome.err.startswith("viso: --set zoom=2: not NAME=VALUE with one of width_px, height_px, ")
    assert "pitch_trim_deg" in outcome.err


def test_folder_for_frames_that_cannot_be_made_is_one_line(viso: Viso) -> None:
    Path("taken").write_text("")
    assert failed_with(viso("landmarks", "--demo", "--frames", "taken"), "taken: File exists")


def test_link_that_cannot_be_opened_is_one_line(viso: Viso) -> None:
    outcome = viso("landmarks", "nosuch:1")
    assert outcome.code == 2
    assert outcome.err.startswith("viso: bad connection string 'nosuch:1': ")


def test_records_of_the_page_are_read(viso: Viso) -> None:
    lines = re.findall(r'^\{".*\}$', PAGE.read_text("utf-8"), re.MULTILINE)
    Path("page.jsonl").write_text("\n".join(lines))
    outcome = viso("landmarks", "page.jsonl", "--json", "--frame", "spherical")
    assert outcome.err == ""
    assert [one["id"] for one in innovations(outcome)] == ["0", "3C6481"]


def test_camera_of_the_page_is_one(viso: Viso) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    Path("camera.toml").write_text(text)
    assert viso("landmarks", *SHORT, "--until", "1", "--camera", "camera.toml").err == ""
    assert set(re.findall(r"^(\w+) =", text, re.MULTILINE)) == set(KEYS)


@pytest.mark.parametrize("command", re.findall(r"^viso landmarks [^`\n]+", PAGE.read_text("utf-8"), re.MULTILINE))
def test_command_of_the_page_works(viso: Viso, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    events = flight(0.4)
    # In the place of files and vehicles that only their owners have.
    monkeypatch.setattr(Merged, "events", lambda _self: iter(events))
    monkeypatch.setattr(Live, "__init__", lambda _self, *_args: None)
    monkeypatch.setattr(Live, "__exit__", lambda _self, *_args: None)
    monkeypatch.setattr(Live, "events", lambda _self, *_args: iter(events))
    monkeypatch.setattr(Live, "refused", lambda _self: {})
    monkeypatch.setattr(landmarks_command, "camera_of", lambda *_args: (Camera(), False))
    monkeypatch.setattr(landmarks_command, "_draw", lambda *_args, **_kwargs: lambda _scene: b"png")
    program, *args = shlex.split(command)
    outcome = viso(*args, "--until", "1")
    assert (program, outcome.code) == ("viso", 0)
    assert not outcome.err or "must never reach" in outcome.err
