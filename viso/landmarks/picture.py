# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a moment, 1600 x 800: predictions and detections, the world from above, on request the sky.

Needs matplotlib (the extra ``plot``). Every artist that stands for something has a group id, such as ``predicted:7``.
"""

import io
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.transforms import ScaledTranslation
from PIL import Image

from viso.landmarks.palette import COLOURS, Colours, Palette
from viso.landmarks.scene import Mark, Pixel, Scene, horizon

WIDTH_PX: Final = 1600
HEIGHT_PX: Final = 800
EXTENT_M: Final = 20_000.0
"""Of the world that is shown, from side to side."""
CONE_SHARE: Final = 0.15
LONGEST_CONE_M: Final = 2000.0
_DPI: Final = 100
_MARGIN: Final = 0.06  # round the picture, for what is just outside
_SMALL: Final = 8
_LEGEND_BELOW_IN: Final = 0.45  # of the axes, so that their labels find room
_NIGHT: Final = "#10151c"
_FRAME: Final = "0.45"
_ON_NIGHT: Final = "0.92"
_CYAN: Final = "#00e5ff"
_ON_WHITE: Final = "black"
_ABOVE_RIGHT: Final = (7.0, 7.0)
_RIGHT: Final = (9.0, -3.0)
_ON_IT: Final = (0.0, -3.0)
_ROOM_PX: Final = 40.0  # an arrow that is longer has room for an id on it
_LABEL_PT: Final = 16
_LABEL_SHARE: Final = 0.2  # of the width of a panel
_LONGEST_TEXT: Final = 60
_VEHICLE: Final = "black"
_ESTIMATED: Final = "#b00020"


def draw(
    scene: Scene, palette: Palette = Palette.SAFE, *, extent_m: float = EXTENT_M, with_sky: bool = False
) -> Figure:
    """Draw a moment: the world is ``extent_m`` from side to side, the sky a disc."""
    colours = COLOURS[palette]
    with style.context("default"):
        figure = Figure(figsize=(WIDTH_PX / _DPI, HEIGHT_PX / _DPI), dpi=_DPI)
        FigureCanvasAgg(figure)
        image, world, sky = _PLACES[with_sky]
        _image_plane(figure.add_axes(image), scene, colours)
        _world(figure.add_axes(world), scene, colours, extent_m)
        if sky is not None:
            _sky(figure.add_axes(sky), scene, colours)
    return figure


_Place = tuple[float, float, float, float]
_PLACES: Final[dict[bool, tuple[_Place, _Place, _Place | None]]] = {
    False: ((0.05, 0.15, 0.53, 0.78), (0.64, 0.15, 0.34, 0.78), None),
    True: ((0.05, 0.15, 0.39, 0.78), (0.50, 0.15, 0.23, 0.78), (0.77, 0.15, 0.22, 0.78)),
}


def pixels_of(figure: Figure) -> npt.NDArray[np.uint8]:
    """Return the picture as RGB, uint8 [800, 1600, 3]."""
    canvas: Any = figure.canvas
    with style.context("default"):
        canvas.draw()
    return np.asarray(canvas.buffer_rgba(), dtype=np.uint8)[:, :, :3].copy()


def png_of(figure: Figure) -> bytes:
    """Return the picture as PNG; the same scene gives the same bytes."""
    file = io.BytesIO()
    Image.fromarray(pixels_of(figure)).save(file, format="PNG")
    return file.getvalue()


def _image_plane(axes: Any, scene: Scene, colours: Colours) -> None:
    camera = scene.situation.camera
    width, height = camera.width_px, camera.height_px
    margin = _MARGIN * max(width, height)
    axes.set_facecolor(_NIGHT)
    axes.set(xlim=(-margin, width + margin), ylim=(height + margin, -margin), xlabel="u, px", ylabel="v, px")
    axes.set_aspect("equal", adjustable="box")
    axes.set_title(f"Image plane at {scene.t_s:.2f} s", fontsize=11)
    axes.add_patch(Rectangle((0, 0), width, height, fill=False, ec=_FRAME, lw=1, gid="image"))
    line = horizon(scene.situation)
    if line is not None:
        axes.plot(*zip(*line, strict=True), "--", color=_ON_NIGHT, lw=1, gid="horizon")
    for mark in scene.landmarks:
        _landmark_in_image(axes, mark, colours)
    for mark in scene.aircraft:
        _aircraft_in_image(axes, mark, colours)
    _image_texts(axes, scene)
    _legend(axes, _image_handles(axes, scene, colours, has_horizon=line is not None), columns=4)


def _landmark_in_image(axes: Any, mark: Mark, colours: Colours) -> None:
    points = [point for point in (mark.predicted, mark.actual) if point is not None]
    if not points:
        return
    _innovation(axes, mark)
    if mark.predicted is not None:
        alpha = 1.0 if mark.in_image else 0.5
        style_ = {"mfc": "none", "mec": colours.predicted, "mew": 1.8, "ms": 11, "alpha": alpha}
        axes.plot(*mark.predicted, "o", gid=f"predicted:{mark.id}", **style_)
    if mark.actual is not None:
        axes.plot(*mark.actual, "x", mec=colours.observed, mew=1.8, ms=9, gid=f"observed:{mark.id}")
    if _has_arrow(mark) and math.dist(points[0], points[1]) > _ROOM_PX:
        (u, v), (other_u, other_v) = points
        _label(axes, ((u + other_u) / 2, (v + other_v) / 2), mark.id, _ON_NIGHT, _ON_IT, "center", gid=f"id:{mark.id}")
    else:
        _label(axes, max(points), mark.id, _ON_NIGHT, _RIGHT, gid=f"id:{mark.id}")


def _aircraft_in_image(axes: Any, mark: Mark, colours: Colours) -> None:
    points = [point for point in (mark.predicted, mark.actual) if point is not None]
    if not points:
        return
    _innovation(axes, mark)
    if mark.predicted is not None:
        axes.plot(*mark.predicted, "^", color=colours.aircraft, ms=10, gid=f"aircraft:{mark.id}")
    if mark.actual is not None:
        edge = colours.observed if mark.seen else _ON_NIGHT
        axes.plot(*mark.actual, "^", mfc="none", mec=edge, mew=1.8, ms=12, gid=f"aircraft_actual:{mark.id}")
    baro = " baro" if mark.is_baro else ""
    text = f"{mark.id} {mark.range_m / 1000:.2f} km{baro}"
    _label(axes, points[0], text, colours.aircraft, gid=f"aircraft_id:{mark.id}")


def _innovation(axes: Any, mark: Mark) -> None:
    if _has_arrow(mark):
        _arrow(axes, mark.predicted, mark.actual, _CYAN, gid=f"arrow:{mark.id}")


def _arrow(axes: Any, start: Any, end: Any, colour: str, shrink_pt: float = 0, *, gid: str) -> None:
    props = {"arrowstyle": "-|>", "color": colour, "lw": 1.3, "shrinkA": shrink_pt, "shrinkB": shrink_pt}
    arrow = axes.annotate("", end, start, arrowprops=props, annotation_clip=False)
    arrow.arrow_patch.set_clip_path(axes.patch)
    arrow.set_gid(gid)


def _has_arrow(mark: Mark) -> bool:
    # Where prediction and observation agree there is nothing to point at.
    return mark.predicted is not None and mark.actual is not None and math.dist(mark.predicted, mark.actual) > 1e-6


def _label(
    axes: Any, at: Pixel, text: str, colour: str, offset: Pixel = _ABOVE_RIGHT, align: str | None = None, *, gid: str
) -> None:
    """Write beside a point; left of it where there is no room on its right, unless alignment is given."""
    left, right = axes.get_xlim()
    if align is None:
        has_room = (right - at[0]) / (right - left) > _LABEL_SHARE
        offset, align = (offset, "left") if has_room else ((-offset[0], offset[1]), "right")
    place = {"textcoords": "offset points", "annotation_clip": True, "zorder": 5}
    shown = axes.annotate(text, at, offset, fontsize=_SMALL, color=colour, ha=align, **place)
    shown.set_gid(gid)
    if colour != _ON_WHITE:
        shown.set_path_effects([withStroke(linewidth=2.5, foreground=_NIGHT)])


def _image_texts(axes: Any, scene: Scene) -> None:
    camera = scene.situation.camera
    fields = f"HFOV {math.degrees(camera.hfov_rad):.2f}°  VFOV {math.degrees(camera.vfov_rad):.2f}°"
    corners = (
        ("fields", fields, 0.01, 0.99, "left", "top"),
        ("counter", f"#{scene.number}", 0.99, 0.99, "right", "top"),
        ("pose", f"[{scene.situation.label}]", 0.99, 0.01, "right", "bottom"),
        ("outside", _outside(scene), 0.01, 0.01, "left", "bottom"),
    )
    for gid, text, x, y, across, upright in corners:
        place = {"transform": axes.transAxes, "ha": across, "va": upright}
        axes.text(x, y, text, color=_ON_NIGHT, fontsize=9, gid=gid, **place)


def _outside(scene: Scene) -> str:
    marks = (*scene.landmarks, *scene.aircraft)
    outside = sum(mark.predicted is not None and not mark.in_image for mark in marks)
    parts = [f"{outside} outside the image"] if outside else []
    unmatched = (*scene.landmark_residuals.unmatched, *scene.aircraft_residuals.unmatched)
    if unmatched:
        parts.append(f"unmatched: {', '.join(unmatched)}")
    text = "; ".join(parts)
    return text if len(text) <= _LONGEST_TEXT else f"{text[: _LONGEST_TEXT - 3]}..."


def _is_visible(axes: Any, at: tuple[float, float] | None) -> bool:
    if at is None:
        return False
    return all(
        min(ends) <= value <= max(ends) for value, ends in zip(at, (axes.get_xlim(), axes.get_ylim()), strict=True)
    )


def _image_handles(axes: Any, scene: Scene, colours: Colours, *, has_horizon: bool) -> list[Line2D]:
    """Return the legend: what is visible, and nothing else."""
    handles = []
    if any(_is_visible(axes, mark.predicted) for mark in scene.landmarks):
        handles.append(_handle("o", "landmark, predicted", mec=colours.predicted, mfc="none", mew=1.8))
    if any(_is_visible(axes, mark.actual) for mark in scene.landmarks):
        handles.append(_handle("x", "landmark, observed", mec=colours.observed, mew=1.8))
    arrows = [mark for mark in (*scene.landmarks, *scene.aircraft) if _has_arrow(mark)]
    if any(_is_visible(axes, mark.predicted) or _is_visible(axes, mark.actual) for mark in arrows):
        handles.append(Line2D([], [], color=_CYAN, lw=1.5, label="innovation"))
    if has_horizon:
        handles.append(Line2D([], [], color="0.4", ls="--", lw=1, label="horizon"))
    if any(_is_visible(axes, mark.predicted) for mark in scene.aircraft):
        handles.append(_handle("^", "aircraft, predicted", color=colours.aircraft))
    actual = [mark for mark in scene.aircraft if _is_visible(axes, mark.actual)]
    if any(mark.seen for mark in actual):
        handles.append(_handle("^", "aircraft, seen in the picture", mec=colours.observed, mfc="none", mew=1.8))
    if any(not mark.seen for mark in actual):
        handles.append(_handle("^", "aircraft, by raw odometry (not seen)", mec="0.4", mfc="none", mew=1.8))
    return handles


def _handle(marker: str, label: str, **looks: Any) -> Line2D:
    return Line2D([], [], lw=0, marker=marker, ms=8, label=label, **looks)


def _legend(axes: Any, handles: list[Line2D], columns: int) -> None:
    below = axes.transAxes + ScaledTranslation(0, -_LEGEND_BELOW_IN, axes.figure.dpi_scale_trans)
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "bbox_transform": below}
    axes.legend(handles=handles, ncols=columns, fontsize=_SMALL, frameon=False, **place)


def _world(axes: Any, scene: Scene, colours: Colours, extent_m: float) -> None:
    odometry, pose, half = scene.situation.odometry, scene.situation.pose, 0.5 * extent_m
    axes.set(xlim=(odometry.x_m - half, odometry.x_m + half), ylim=(odometry.y_m - half, odometry.y_m + half))
    axes.set(xlabel="east, m", ylabel="north, m")
    axes.set_aspect("equal", adjustable="box")
    axes.set_title("World", fontsize=11)
    axes.locator_params(nbins=5)
    axes.grid(alpha=0.3)
    cone = _cone(scene, extent_m)
    axes.add_patch(cone)
    for mark in scene.landmarks:
        axes.plot(mark.x_m, mark.y_m, "s", color=colours.landmark, ms=5, gid=f"landmark:{mark.id}")
    for mark in scene.aircraft:
        axes.plot(mark.x_m, mark.y_m, "^", color=colours.aircraft, ms=9, gid=f"world_aircraft:{mark.id}")
        _label(axes, (mark.x_m, mark.y_m), mark.id, _ON_WHITE, gid=f"world_id:{mark.id}")
    axes.plot(odometry.x_m, odometry.y_m, "o", color=_VEHICLE, ms=6, gid="vehicle")
    handles = [_handle("o", "vehicle (odometry)", color=_VEHICLE)]
    if scene.situation.is_estimated:
        _arrow(axes, (odometry.x_m, odometry.y_m), (pose.x_m, pose.y_m), _ESTIMATED, 4, gid="to_estimated")
        axes.plot(pose.x_m, pose.y_m, "D", color=_ESTIMATED, ms=6, gid="estimated")
        if _is_visible(axes, (pose.x_m, pose.y_m)):
            handles.append(_handle("D", "vehicle (estimated)", color=_ESTIMATED))
        else:
            handles.append(Line2D([], [], color=_ESTIMATED, lw=1.3, label="to the vehicle (estimated)"))
    axes.plot(*scene.situation.camera_xyz[:2], "+", color="0.35", ms=11, mew=1.5, gid="camera")
    if any(_is_visible(axes, corner) for corner in cone.get_xy().tolist()):
        handles.append(_handle("+", "camera and its view", mec="0.35", mew=1.5))
    if any(_is_visible(axes, (mark.x_m, mark.y_m)) for mark in scene.landmarks):
        handles.append(_handle("s", "landmark", color=colours.landmark))
    if any(_is_visible(axes, (mark.x_m, mark.y_m)) for mark in scene.aircraft):
        handles.append(_handle("^", "aircraft", color=colours.aircraft))
    _legend(axes, handles, columns=3)


def _cone(scene: Scene, extent_m: float) -> Polygon:
    length, half = min(CONE_SHARE * extent_m, LONGEST_CONE_M), 0.5 * scene.situation.camera.hfov_rad
    x, y, _ = scene.situation.camera_xyz.tolist()
    middle = scene.situation.view_yaw_rad
    angles = np.linspace(middle - half, middle + half, 25)
    rim = np.column_stack([x + length * np.cos(angles), y + length * np.sin(angles)])
    return Polygon(np.vstack([(x, y), rim]), closed=True, fc="#f2c230", ec="#8a6d00", alpha=0.45, lw=1, gid="cone")


def _sky(axes: Any, scene: Scene, colours: Colours) -> None:
    axes.set(xlim=(-1.2, 1.2), ylim=(-1.2, 1.2), xticks=[], yticks=[])
    axes.set_aspect("equal", adjustable="box")
    axes.set_title("All sky, zenith in the middle", fontsize=11)
    axes.set_frame_on(False)
    axes.add_patch(Circle((0, 0), 1, fc=_NIGHT, ec=_FRAME, lw=1, gid="sky"))
    for elevation_deg in (30, 60):
        radius = 1 - elevation_deg / 90
        axes.add_patch(Circle((0, 0), radius, fill=False, ec=_FRAME, lw=0.7, ls=":"))
        axes.text(0.71 * radius, -0.71 * radius, f"{elevation_deg}°", color="0.6", fontsize=7, ha="center", va="center")
    half = 0.5 * scene.situation.camera.hfov_rad
    for side in (-half, half):
        axes.plot([0, -math.sin(side)], [0, math.cos(side)], color="#f2c230", lw=0.8, gid="view")
    for text, x, y in (("forward", 0, 1.09), ("left", -1.11, 0), ("right", 1.11, 0), ("back", 0, -1.09)):
        axes.text(x, y, text, fontsize=_SMALL, ha="center", va="center", rotation=0 if x == 0 else 90)
    above = [mark for mark in scene.aircraft if mark.elevation_rad is not None and mark.elevation_rad >= 0]
    for mark in above:
        at = sky_place(mark)
        axes.plot(*at, "^", color=colours.aircraft, ms=9, gid=f"sky_aircraft:{mark.id}")
        # Towards the middle, where there is room.
        x, y = at
        inwards = _LABEL_PT / max(math.hypot(x, y), 1e-9)
        align = "left" if x < -0.5 else "right" if x > 0.5 else "center"
        offset = (-x * inwards, -y * inwards)
        _label(axes, at, mark.id, colours.aircraft, offset, align, gid=f"sky_id:{mark.id}")


def sky_place(mark: Mark) -> tuple[float, float]:
    """Return where a mark is on the disc of the sky: its radius is 1 at the horizon, forward is up, left is left."""
    assert mark.elevation_rad is not None
    radius = (0.5 * math.pi - mark.elevation_rad) / (0.5 * math.pi)
    return -radius * math.sin(mark.azimuth_rad), radius * math.cos(mark.azimuth_rad)
