# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a moment: its size, its elements and where they are, its colours, its texts."""

import dataclasses
import io
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from PIL import Image

from tests.unit.viso.landmarks.scenes import flown
from viso.landmarks.local_frame import FrameMode
from viso.landmarks.palette import COLOURS, Palette
from viso.landmarks.picture import EXTENT_M, draw, pixels_of, png_of, sky_place
from viso.landmarks.scene import Mark, Scene, make_scene
from viso.landmarks.synthetic import LANDMARKS, Planted, SyntheticFlight
from viso.landmarks.types import (
    Camera,
    Detection,
    Detections,
    EstimatedPosition,
    GeodeticPoint,
    VehiclePose,
)

FLIGHT = SyntheticFlight(duration_s=1.0, mode=FrameMode.SPHERICAL)
OFF = dataclasses.replace(FLIGHT, planted=Planted(math.radians(3)))
ICAO = "3C6481"


@cache
def last_scene(flight: SyntheticFlight = FLIGHT, **settings: object) -> Scene:
    return flown(flight, **settings)[-1]


def last_picture(flight: SyntheticFlight = FLIGHT, palette: Palette = Palette.SAFE) -> Figure:
    """Return the picture of that scene, for looking at alone."""
    return drawn(flight, palette)


@cache
def drawn(flight: SyntheticFlight, palette: Palette) -> Figure:
    return draw(last_scene(flight), palette)


@cache
def picture_with_sky() -> Figure:
    return draw(last_scene(), with_sky=True)


@cache
def estimated_picture() -> Figure:
    return draw(estimated_scene())


@cache
def estimated_scene() -> Scene:
    """Return a scene that an estimated position predicts, some 1.5 km from the vehicle, and nothing was seen."""
    place = EstimatedPosition(0.0, GeodeticPoint(47.41, 8.55))
    scene = flown(FLIGHT, place, from_estimate=True)[-1]
    return make_scene(7, scene.situation, Detections(scene.t_s))


def elements(figure: Figure) -> dict[str, Any]:
    """Return the artists that stand for something, by their ids."""
    found = figure.findobj(lambda artist: bool(artist.get_gid()))
    return {str(artist.get_gid()): artist for artist in found}


def names(figure: Figure, kind: str) -> list[str]:
    return sorted(gid.partition(":")[2] for gid in elements(figure) if gid.partition(":")[0] == kind)


def place(artist: Any) -> tuple[float, float]:
    (x,), (y,) = artist.get_data()
    return float(x), float(y)


def legend(figure: Figure, panel: int) -> list[str]:
    shown = figure.axes[panel].get_legend()
    assert shown is not None
    return [text.get_text() for text in shown.get_texts()]


@pytest.mark.slow
@pytest.mark.parametrize("with_sky", [False, True])
def test_size_is_1600_by_800_in_rgb(with_sky: bool) -> None:
    figure = draw(last_scene(), with_sky=with_sky)
    assert pixels_of(figure).shape == (800, 1600, 3)
    with Image.open(io.BytesIO(png_of(figure))) as picture:
        assert (picture.size, picture.mode) == ((1600, 800), "RGB")


@pytest.mark.slow
def test_same_scene_gives_the_same_bytes() -> None:
    assert png_of(draw(last_scene(OFF))) == png_of(draw(last_scene(OFF)))


def test_landmarks_are_circles_where_predicted_and_crosses_where_seen() -> None:
    scene = last_scene(OFF)
    figure = last_picture(OFF)
    shown = elements(figure)
    assert names(figure, "predicted") == names(figure, "observed") == names(figure, "id") == list("01234")
    for one in scene.landmark_residuals.innovations:
        circle, cross = shown[f"predicted:{one.id}"], shown[f"observed:{one.id}"]
        assert (circle.get_marker(), cross.get_marker()) == ("o", "x")
        assert place(circle) == (one.predicted_u_px, one.predicted_v_px)
        assert place(cross) == (one.observed_u_px, one.observed_v_px)


def test_arrows_lead_from_prediction_to_observation() -> None:
    scene = last_scene(OFF)
    shown = elements(last_picture(OFF))
    for one in scene.landmark_residuals.innovations:
        arrow = shown[f"arrow:{one.id}"]
        assert arrow.xy == (one.observed_u_px, one.observed_v_px)
        assert arrow.xyann == (one.predicted_u_px, one.predicted_v_px)
        assert same_color(arrow.arrow_patch.get_edgecolor(), "#00e5ff")


def test_ids_are_at_the_middle() -> None:
    scene = last_scene(OFF)
    shown = elements(last_picture(OFF))
    one = scene.landmark_residuals.innovations[0]
    middle = 0.5 * (one.predicted_u_px + one.observed_u_px), 0.5 * (one.predicted_v_px + one.observed_v_px)
    assert shown[f"id:{one.id}"].xy == pytest.approx(middle)
    assert shown[f"id:{one.id}"].get_text() == one.id


def test_agreement_has_no_arrow() -> None:
    figure = last_picture()
    assert names(figure, "arrow") == []
    assert "innovation" not in legend(figure, 0)


def test_aircraft_are_triangles_with_address_and_range() -> None:
    scene = last_scene()
    figure = last_picture()
    shown = elements(figure)
    assert names(figure, "aircraft") == names(figure, "aircraft_actual") == [ICAO, "4B1803"]
    assert shown[f"aircraft:{ICAO}"].get_marker() == "^"
    range_km = next(mark.range_m for mark in scene.aircraft if mark.id == ICAO) / 1000
    assert shown[f"aircraft_id:{ICAO}"].get_text() == f"{ICAO} {range_km:.2f} km baro"


@pytest.mark.slow
def test_range_of_a_corrected_height_does_not_say_baro() -> None:
    flight = dataclasses.replace(FLIGHT, qnh_offset_m=30.0)
    shown = elements(draw(last_scene(flight, qnh_offset_m=30.0)))
    assert shown[f"aircraft_id:{ICAO}"].get_text().endswith(" km")


def test_aircraft_too_far_away_is_nowhere_and_one_of_unknown_height_only_in_the_world() -> None:
    figure = picture_with_sky()
    world, image = names(figure, "world_aircraft"), names(figure, "aircraft")
    assert "A0B1C2" not in world
    assert "3E12FF" in world
    assert "3E12FF" not in image + names(figure, "sky_aircraft")


def test_flight_without_aircraft_has_none_in_the_legends() -> None:
    figure = draw(last_scene(dataclasses.replace(FLIGHT, traffic=())))
    assert names(figure, "aircraft") == names(figure, "world_aircraft") == []
    assert not [text for panel in (0, 1) for text in legend(figure, panel) if "aircraft" in text]


def test_legend_holds_only_what_is_visible() -> None:
    scene = last_scene()
    away = tuple(dataclasses.replace(mark, predicted=(-1e4, 0.0), actual=None, x_m=1e6) for mark in scene.landmarks)
    figure = draw(dataclasses.replace(scene, landmarks=away))
    assert not [text for panel in (0, 1) for text in legend(figure, panel) if "landmark" in text]


def test_legend_of_the_world_names_the_estimated_vehicle_and_the_camera_where_they_are_shown() -> None:
    near = legend(draw(estimated_scene(), extent_m=1000.0), 1)
    assert near == ["vehicle (odometry)", "to the vehicle (estimated)", "landmark"]
    assert legend(estimated_picture(), 1)[:3] == ["vehicle (odometry)", "vehicle (estimated)", "camera and its view"]


def test_legend_says_whether_the_actual_place_was_seen() -> None:
    seen = legend(last_picture(), 0)
    unseen = legend(estimated_picture(), 0)
    assert "aircraft, seen in the picture" in seen
    assert "aircraft, by raw odometry (not seen)" not in seen
    assert "aircraft, by raw odometry (not seen)" in unseen
    assert "aircraft, seen in the picture" not in unseen


def test_texts_are_in_the_corners() -> None:
    shown = elements(last_picture())
    assert shown["fields"].get_text() == "HFOV 65.24°  VFOV 54.22°"
    assert (shown["fields"].get_ha(), shown["fields"].get_va()) == ("left", "top")
    assert shown["counter"].get_text() == "#6"
    assert (shown["counter"].get_ha(), shown["counter"].get_va()) == ("right", "top")
    assert shown["pose"].get_text() == "[odom]"
    assert (shown["pose"].get_ha(), shown["pose"].get_va()) == ("right", "bottom")


@pytest.mark.slow
def test_all_texts_are_inside_the_picture() -> None:
    for scene in (last_scene(OFF), estimated_scene()):
        figure = draw(scene, with_sky=True)
        pixels_of(figure)
        for text in figure.findobj(lambda artist: hasattr(artist, "get_text") and artist.get_visible()):
            if text.get_text():  # type: ignore[attr-defined]
                box = text.get_window_extent()
                assert box.x0 >= 0, text
                assert box.x1 <= 1600, text
                assert box.y0 >= 0, text
                assert box.y1 <= 800, text


def test_u_is_to_the_right_and_v_down() -> None:
    axes = last_picture().axes[0]
    assert axes.get_xlim()[0] < axes.get_xlim()[1]
    assert axes.get_ylim()[0] > axes.get_ylim()[1]


@pytest.mark.parametrize(("trim_deg", "row"), [(0, 512.0), (5, 599.4887), (-5, 424.5113)])
def test_horizon_is_dashed_where_the_trim_puts_it(trim_deg: float, row: float) -> None:
    flight = dataclasses.replace(FLIGHT, camera=Camera(pitch_trim_rad=math.radians(trim_deg)))
    line = elements(last_picture(flight))["horizon"]
    assert line.get_linestyle() == "--"
    assert line.get_xdata() == pytest.approx([0, 1280])
    assert line.get_ydata() == pytest.approx([row, row], abs=1e-3)


def test_horizon_outside_the_picture_is_not_drawn() -> None:
    flight = dataclasses.replace(FLIGHT, camera=Camera(pitch_trim_rad=math.radians(40)))
    figure = draw(last_scene(flight))
    assert "horizon" not in elements(figure)
    assert "horizon" not in legend(figure, 0)


def test_horizon_leans_with_a_vehicle_that_banks() -> None:
    roll = math.radians(10)  # right wing down
    c, s = math.cos(roll), math.sin(roll)
    bank = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    pose = VehiclePose(0.0, 0.0, 0.0, 0.0, world_R_body=bank)
    situation = dataclasses.replace(last_scene().situation, pose=pose, odometry=pose)
    line = elements(draw(make_scene(1, situation, Detections(0.0))))["horizon"]
    (left, right), middle = line.get_ydata(), 512
    assert (left - middle, right - middle) == pytest.approx((640 * math.tan(roll), -640 * math.tan(roll)))


@pytest.mark.slow
def test_prediction_outside_the_image_is_kept_faint_and_counted() -> None:
    narrow = dataclasses.replace(last_scene().situation, camera=Camera(width_px=400))
    figure = draw(make_scene(1, narrow, Detections(0.0)))
    assert elements(figure)["predicted:4"].get_alpha() == 0.5
    assert "outside the image" in elements(figure)["outside"].get_text()


def test_ids_that_are_not_known_are_told() -> None:
    scene = make_scene(1, last_scene().situation, Detections(1.0, (Detection("17", 5.0, 6.0),)))
    assert elements(draw(scene))["outside"].get_text().endswith("unmatched: 17")


@pytest.mark.parametrize("palette", Palette)
def test_colours_are_those_of_the_palette(palette: Palette) -> None:
    shown, colours = elements(last_picture(OFF, palette)), COLOURS[palette]
    assert shown["predicted:0"].get_markeredgecolor() == colours.predicted
    assert shown["observed:0"].get_markeredgecolor() == colours.observed
    assert shown["landmark:0"].get_color() == colours.landmark
    assert shown[f"aircraft:{ICAO}"].get_color() == shown[f"world_aircraft:{ICAO}"].get_color() == colours.aircraft


def test_safe_colours_are_drawn_unless_others_are_asked_for() -> None:
    assert elements(last_picture())["predicted:0"].get_markeredgecolor() == COLOURS[Palette.SAFE].predicted


def test_world_is_centred_on_the_vehicle_and_20_km_wide() -> None:
    scene = last_scene()
    axes = last_picture().axes[1]
    at = scene.situation.odometry
    assert axes.get_xlim() == pytest.approx((at.x_m - 10_000, at.x_m + 10_000))
    assert axes.get_ylim() == pytest.approx((at.y_m - 10_000, at.y_m + 10_000))
    assert place(elements(last_picture())["vehicle"]) == (at.x_m, at.y_m)


def test_landmarks_and_aircraft_are_in_the_world() -> None:
    scene = last_scene()
    shown = elements(last_picture())
    assert place(shown["landmark:2"]) == (LANDMARKS[2].x_m, LANDMARKS[2].y_m)
    state = next(one for one in scene.situation.states if one.report.icao == ICAO)
    at = scene.situation.odometry
    assert place(shown[f"world_aircraft:{ICAO}"]) == pytest.approx((at.x_m + state.east_m, at.y_m + state.north_m))


@pytest.mark.parametrize(("extent_m", "length_m"), [(EXTENT_M, 2000.0), (10_000.0, 1500.0), (100.0, 15.0)])
def test_cone_has_the_field_of_view(extent_m: float, length_m: float) -> None:
    scene = last_scene()
    figure = last_picture() if extent_m == EXTENT_M else draw(scene, extent_m=extent_m)
    corners = elements(figure)["cone"].get_xy()
    tip, rim = corners[0], corners[1:-1]
    assert tip == pytest.approx(scene.situation.camera_xyz[:2])
    assert np.hypot(*(rim - tip).T) == pytest.approx(length_m)
    angles = np.unwrap(np.arctan2(*(rim - tip).T[::-1]))
    half = 0.5 * scene.situation.camera.hfov_rad
    yaw = scene.situation.pose.yaw_rad
    assert (angles[0], angles[-1]) == pytest.approx((yaw - half, yaw + half))


@pytest.mark.slow
def test_estimated_vehicle_and_the_way_to_it_are_drawn() -> None:
    scene = estimated_scene()
    shown = elements(estimated_picture())
    pose, odometry = scene.situation.pose, scene.situation.odometry
    assert shown["pose"].get_text() == "[estimated]"
    assert place(shown["estimated"]) == (pose.x_m, pose.y_m)
    assert (shown["to_estimated"].xyann, shown["to_estimated"].xy) == (
        (odometry.x_m, odometry.y_m),
        (pose.x_m, pose.y_m),
    )
    assert place(shown["camera"]) == pytest.approx((pose.x_m, pose.y_m))


def test_odometry_alone_has_no_estimated_vehicle() -> None:
    shown = elements(last_picture())
    assert "estimated" not in shown
    assert "to_estimated" not in shown


@pytest.mark.parametrize(
    ("elevation_deg", "azimuth_deg", "expected"),
    [
        (90, 77, (0, 0)),
        (0, 0, (0, 1)),
        (0, 90, (-1, 0)),
        (0, -90, (1, 0)),
        (45, 180, (0, -0.5)),
    ],
)
def test_sky_is_a_disc_with_forward_up(elevation_deg: float, azimuth_deg: float, expected: tuple[float, float]) -> None:
    elevation, azimuth = math.radians(elevation_deg), math.radians(azimuth_deg)
    mark = Mark("A", 0.0, 0.0, None, None, False, 1.0, elevation_rad=elevation, azimuth_rad=azimuth)
    assert sky_place(mark) == pytest.approx(expected, abs=1e-12)


def test_sky_has_all_aircraft_above_the_horizon() -> None:
    figure = picture_with_sky()
    assert len(figure.axes) == 3
    assert names(figure, "sky_aircraft") == sorted(["3C6481", "4B1803", "4B43AA", "440172"])
    assert len(last_picture().axes) == 2
