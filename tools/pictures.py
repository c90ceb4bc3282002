# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the pictures of the pages: the way of a message, frames, alignment, horizon, filter; each in light and in dark.

Codes and outcomes come from the tables of the code; `tools/make_docs.py` writes the files and checks them.
A page shows one with `<picture>`, whose `<source>` asks for the reader's colour scheme, as GitHub does. The site makes
two images of it (`tools/site_hooks.py`), so that its own switch between light and dark counts. The ground is part of a
picture: where neither works, it can still be read.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final

from ap_core.verdict import Rule, Verdict
from ap_visualodom import verdicts as port
from ekf_stub.core.samples import HALF_FILTER_STEP_MS
from ekf_stub.inputs import ingest_rules as ekf
from mav_handlers import verdicts as endpoint
from viso.vehicle.outcomes.labels import fate_of

WIDTH: Final = 720
FONT: Final = '"DejaVu Sans", Verdana, sans-serif'
MONO: Final = '"DejaVu Sans Mono", Menlo, Consolas, monospace'
_COLOURS: Final[Mapping[str, Mapping[str, str]]] = {
    "light": {"ground": "#ffffff", "box": "#eef3f9", "edge": "#a9b8c9", "ink": "#1c2733", "soft": "#566575"}
    | {"red": "#b3261e", "amber": "#8a5a00", "green": "#1d6b37", "blue": "#1f5fa8"},
    "dark": {"ground": "#15191f", "box": "#222a34", "edge": "#4d5b6b", "ink": "#e6ebf1", "soft": "#a7b4c2"}
    | {"red": "#ff8f86", "amber": "#f0b95a", "green": "#7fd39a", "blue": "#86b8f5"},
}
_OF_OUTCOME: Final[Mapping[str, str]] = {
    **dict.fromkeys(("dropped", "refused", "lost", "rejected"), "red"),
    **dict.fromkeys(("ignored", "unused"), "amber"),
    **dict.fromkeys(("accepted", "fused", "reset"), "green"),
}

Point = tuple[float, float]
Picture = tuple[float, list[str]]
"""The height of a picture in px, and its parts."""


def _text(x: float, y: float, words: str, look: str = "", anchor: str = "start") -> str:
    look = f' class="{look}"' if look else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{look}>{words}</text>'


def _lines(x: float, y: float, *lines: str, look: str = "") -> list[str]:
    return [_text(x, y + 16 * row, line, look) for row, line in enumerate(lines)]


def _box(x: float, y: float, width: float, height: float, look: str = "box") -> str:
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="5" class="{look}"/>'


def _path(points: Sequence[Point], colour: str = "soft", *, dashed: bool = False, arrow: bool = True) -> str:
    """Return a line through points, with an arrow head at its end."""
    line = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    look = f"line {colour}-line{' dashed' if dashed else ''}"
    return f'<path d="M{line}" class="{look}"' + (f' marker-end="url(#{colour})"' if arrow else "") + "/>"


def _dot(x: float, y: float, colour: str) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" class="{colour}"/>'


def _style(colours: Mapping[str, str]) -> str:
    rules = [
        f"text {{ font: 12px {FONT}; fill: {colours['ink']} }}",
        ".title { font-size: 13px; font-weight: bold }",
        f".code {{ font-family: {MONO} }}",
        f".box {{ fill: {colours['box']}; stroke: {colours['edge']} }}",
        ".line { fill: none; stroke-width: 1.8 }",
        ".dashed { stroke-dasharray: 6 4 }",
    ]
    for name, colour in colours.items():
        rules += [f".{name} {{ fill: {colour} }}", f".{name}-line {{ stroke: {colour} }}"]
    return "\n".join(rules)


def _svg(picture: Picture, scheme: str) -> str:
    height, parts = picture
    heads = [
        f'<marker id="{name}" viewBox="0 0 8 8" refX="6.5" refY="4" markerWidth="9" markerHeight="9" '
        f'markerUnits="userSpaceOnUse" orient="auto"><path d="M0 0L8 4L0 8z" class="{name}"/></marker>'
        for name in ("soft", "red", "amber", "green", "blue")
    ]
    size = f'width="{WIDTH}" height="{height:.0f}" viewBox="0 0 {WIDTH} {height:.0f}"'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
            f"<style>\n{_style(_COLOURS[scheme])}\n</style>",
            *("<defs>", *heads, "</defs>"),
            '<rect width="100%" height="100%" class="ground"/>',
            *(*parts, "</svg>", ""),
        ]
    )


# The way of a message

_STAGES: Final[tuple[tuple[str, str, tuple[str, ...], tuple[Verdict | Rule, ...]], ...]] = (
    (
        "Link and parser",
        "mav_handlers/links, mav_handlers/wire",
        ("Bytes become a frame.",),
        (
            *(endpoint.BAD_PREFIX, endpoint.BAD_CRC, endpoint.BAD_FRAME, endpoint.UNKNOWN_MESSAGE),
            *(endpoint.UNSIGNED, endpoint.BAD_SIGNATURE, endpoint.SIGNATURE_REPLAYED, endpoint.SIGNATURE_OLD),
            endpoint.SIGNATURE_STREAMS,
        ),
    ),
    (
        "Routing",
        "mav_handlers/routing.py",
        ("Is it for this autopilot, and does a handler take it?",),
        (endpoint.OWN_MESSAGE, endpoint.NOT_ADDRESSED, endpoint.NOT_ACCEPTED, endpoint.NO_HANDLER),
    ),
    (
        "Handler",
        "mav_handlers/handlers/vision.py",
        ("Jitter correction: the stamp becomes time since", "boot. The covariance becomes an error."),
        (endpoint.ODOMETRY_FRAMES,),
    ),
    (
        "AP_VisualOdom",
        "ap_visualodom/",
        ("The backend of VISO_TYPE scales and aligns.", "Log: VISP, VISV, VISO; ignored samples too."),
        (port.DISABLED, port.NO_BACKEND, port.QUALITY_BELOW_MIN, port.RESET_SETTLING, port.CONSUMED),
    ),
    (
        "Input of the filter",
        "ekf_stub/inputs/ext_nav_ingest.py",
        ("VISO_DELAY_MS is subtracted.", "Log, if LOG_REPLAY is 1: REPH, REVH, RBOH."),
        (
            *(ekf.NOT_STARTED, ekf.NOT_A_NUMBER, ekf.YAW_NOT_A_NUMBER, ekf.TOO_SOON, ekf.TOO_SHORT),
            *(ekf.NOT_INITIALISED, ekf.NO_BUFFER),
        ),
    ),
    (
        "Buffer",
        "ekf_stub/inputs/obs_ring.py",
        ("The sample waits until the horizon", "reaches the time of its observation."),
        (ekf.OVERWRITTEN, ekf.SUPERSEDED, ekf.TOO_OLD),
    ),
    (
        "Fusion",
        "ekf_stub/fusion/",
        ("Each measurement is tested against its gate.", "Log: XKF1 to XKF4 and others."),
        (
            *(ekf.GATE_POSITION, ekf.GATE_VELOCITY, ekf.GATE_HEIGHT, ekf.GATE_YAW, ekf.GATE_ODOMETRY),
            *(ekf.NOT_FINITE, ekf.UNUSED, ekf.RESET_TO, ekf.ALIGNED_TO, ekf.FUSED),
        ),
    ),
)  # fmt: skip
_STAGES_OF_MESSAGE: Final = 4  # the others are of its samples
_MOST_LETTERS: Final = 37


def _exits(verdicts: Sequence[Verdict | Rule]) -> Iterator[tuple[str, str]]:
    """Yield outcome and codes, a line each; the outcome is empty where a line goes on with that above."""
    codes: dict[str, list[str]] = {}
    for one in verdicts:
        outcome, rule = (fate_of(one), one) if isinstance(one, Rule) else (one.outcome, one.rule)
        codes.setdefault(outcome.value, []).append(rule.code)
    for name, of_outcome in codes.items():
        lines = textwrap.wrap(", ".join(of_outcome), _MOST_LETTERS)
        yield from zip((name, *[""] * (len(lines) - 1)), lines, strict=True)


def _message() -> Picture:
    parts, top = [], 36.0
    for count, (title, place, about, verdicts) in enumerate(_STAGES):
        if count in (0, _STAGES_OF_MESSAGE):
            parts.append(_text(364, top - 14, "Fate of each sample" if count else "Verdict of the message", "title"))
        exits = list(_exits(verdicts))
        height = max(48 + 16 * len(about), 16 * len(exits) + 14)
        parts += [
            _box(12, top, 330, height),
            _text(24, top + 20, title, "title"),
            _text(24, top + 37, place, "code soft"),
        ]
        parts += _lines(24, top + 54, *about)
        y = top + height / 2 - 8 * len(exits) + 12
        for outcome, codes in exits:
            if outcome:
                colour = _OF_OUTCOME[outcome]
                parts += [_path([(342, y - 4), (360, y - 4)], colour)] if colour != "green" else []
                parts.append(_text(364, y, outcome, colour))
            parts.append(_text(430, y, codes, "code"))
            y += 16
        gap = 0 if count == len(_STAGES) - 1 else 44 if count == _STAGES_OF_MESSAGE - 1 else 22
        parts += [_path([(177, top + height), (177, top + height + gap - 2)])] if gap else []
        parts += [_text(188, top + height + 26, "its samples", "soft")] if gap > 22 else []
        top += height + gap
    parts.append(
        _text(12, top + 24, "Codes with model_ are the opinion of a model of EKF3. All others are exact.", "soft")
    )
    return top + 40, parts


# Frames

_Axes = Sequence[tuple[str, float, float]]
# Oblique: north and ahead go up and to the right, east and right to the right, down goes down.
_WORLD: Final = {"north": (0.6, -0.52), "east": (0.95, 0.2), "up": (0.0, -0.9), "down": (0.0, 0.9)}
_BODY: Final = {"forward": (0.6, -0.52), "right": (0.95, 0.2), "left": (-0.95, -0.2), "up": (0, -0.9), "down": (0, 0.9)}


def _triad(x: float, y: float, names: Sequence[str], ways: Mapping[str, Point]) -> list[str]:
    parts = []
    for letter, colour, name in zip("xyz", ("red", "green", "blue"), names, strict=True):
        across, down = (62 * part for part in ways[name])
        anchor = "end" if across < 0 else "start" if across else "middle"
        shift = 6 if across > 0 else -6 if across < 0 else 0
        words_y = y + down + 4 + (0 if across else math.copysign(11, down))
        parts += [_path([(x, y), (x + across, y + down)], colour)]
        parts.append(_text(x + across + shift, words_y, f"{letter} {name}", colour, anchor))
    return parts


def _drone(x: float, y: float, yaw_deg: float = 0.0, size: float = 1.0) -> list[str]:
    """Return a vehicle from above, whose nose points up at a yaw of 0."""
    arms = [(12, -12), (12, 12), (-12, 12), (-12, -12)]
    body = [
        *(f'<circle cx="{a}" cy="{b}" r="8" class="box"/>' for a, b in arms),
        '<path d="M0 -15L7 9L-7 9z" class="soft"/>',
    ]
    return [f'<g transform="translate({x:.1f} {y:.1f}) rotate({yaw_deg:.0f}) scale({size})">', *body, "</g>"]


def _frames() -> Picture:
    parts = [_box(8, 8, 348, 214), _box(364, 8, 348, 214)]
    for left, title, x, low, world, body in (
        (8, "ArduPilot", 214, 118, ("NED", "north", "east", "down"), ("FRD", "forward", "right", "down")),
        (364, "ROS", 240, 160, ("ENU", "east", "north", "up"), ("FLU", "forward", "left", "up")),
    ):
        parts.append(_text(left + 14, 30, title, "title"))
        parts += [_text(left + 14, 52, f"world: {world[0]}"), _text(left + 186, 52, f"body: {body[0]}")]
        parts += _triad(left + 44, low, world[1:], _WORLD) + _triad(left + x, low, body[1:], _BODY)
    parts += [_text(12, 246, "From ROS to ArduPilot", "title")]
    parts += _lines(
        190, 246, "NED from ENU: north = y, east = x, down = -z", "FRD from FLU: forward = x, right = -y, down = -z"
    )
    parts += [_text(12, 290, "ODOMETRY", "title")]
    parts += _lines(
        *(190, 290, "position, attitude: frame_id 20, LOCAL_FRD. Down is z; x is ahead at the"),
        *("start, or north. Velocity: child_frame_id 12, BODY_FRD, with the vehicle.",),
    )
    for left, width, title in (
        (8, 234, "Local frame of a camera"),
        (250, 226, "VISO_POS_X, _Y, _Z"),
        (484, 228, "VISO_ORIENT"),
    ):
        parts += [_box(left, 322, width, 250), _text(left + 12, 344, title, "title")]
    # The camera's local frame, from above
    parts += [_path([(74, 496), (74, 410)]), _text(74, 402, "north", "soft", "middle")]
    parts += [_path([(74, 496), (140, 442)], "red"), _text(146, 442, "x", "red")]
    parts += [_path([(74, 496), (122, 555)], "green"), _text(128, 558, "y", "green")]
    parts += [_path([(74, 496), (136, 478), (196, 496)], "amber", dashed=True), *_drone(74, 496, 51, 0.8)]
    parts += _lines(20, 366, "It starts at 0, with x ahead.", "It does not know north.")
    # Its place on the vehicle: from above, and from the side
    parts += [*_drone(320, 446, 0, 1.5), _dot(346, 398, "amber")]
    parts += [_path([(320, 446), (320, 398)], "red"), _path([(320, 398), (341, 398)], "green")]
    parts += [
        _text(313, 396, "X", "red", "end"),
        _text(330, 390, "Y", "green", "middle"),
        _text(356, 402, "camera", "amber"),
    ]
    parts += [
        _box(392, 434, 70, 14),
        _path([(427, 441), (427, 476)], "blue"),
        _dot(427, 481, "amber"),
        _text(436, 466, "Z", "blue"),
    ]
    parts += [_text(320, 500, "from above", "soft", "middle"), _text(427, 502, "side", "soft", "middle")]
    parts += _lines(262, 366, "m: forward, right, down")
    parts += _lines(262, 528, "The filter moves the pose", "from here to the IMU.")
    # How it is turned
    parts += _drone(598, 440)
    for angle, words in ((0, "0 forward"), (90, "2 right"), (180, "4 back"), (270, "6 left")):
        across, down = math.sin(math.radians(angle)), -math.cos(math.radians(angle))
        parts.append(_path([(598 + 26 * across, 440 + 26 * down), (598 + 46 * across, 440 + 46 * down)], "amber"))
        anchor = {90: "start", 270: "end"}.get(angle, "middle")
        parts.append(_text(598 + 52 * across, 440 + 54 * down + 4 + 4 * (down > 0.5) * 2, words, "", anchor))
    parts += [_text(496, 366, "24 up, 25 down")]
    parts += _lines(496, 532, "Turns attitudes of VISO_TYPE", "2 and 3, and each", "VISION_POSITION_DELTA.")
    return 580, parts


# The alignment

_YAW_OF_CAMERA: Final = 10
_YAW_OF_VEHICLE: Final = 60
_LEGS: Final = ((0.0, 0.0), (0.0, 62.0), (0.0, 118.0), (62.0, 118.0))  # right and ahead, px


def _turned(point: Point, yaw_deg: float) -> Point:
    """Return right and ahead of a vehicle as east and north."""
    angle = math.radians(yaw_deg)
    right, ahead = point
    return right * math.cos(angle) + ahead * math.sin(angle), ahead * math.cos(angle) - right * math.sin(angle)


def _alignment() -> Picture:
    """The same way thrice: what the vehicle flies, and where the camera sees itself before and after each alignment."""
    truth = [_turned(leg, _YAW_OF_VEHICLE) for leg in _LEGS]
    seen = [_turned(leg, _YAW_OF_CAMERA) for leg in _LEGS]
    kept = [(x - truth[1][0] + seen[1][0], y - truth[1][1] + seen[1][1]) for x, y in truth]
    parts = []
    for count, (title, after, about) in enumerate(
        (
            ("1  not aligned", seen, ("Its x is not north:", "the yaw is 50 degrees off.")),
            ("2  yaw aligned", kept, ("At the dot its frame is turned by", "50 degrees about that place.")),
            ("3  position aligned", truth, ("At the dot its frame is shifted,", "too, to where the vehicle is.")),
        )
    ):
        left = 8 + 237 * count
        x, y = left + 52, 214.0
        on_page = [[(x + east, y - north) for east, north in way] for way in (truth, seen, after)]
        parts += [_box(left, 8, 230, 306), _text(left + 12, 30, title, "title"), *_lines(left + 12, 278, *about)]
        parts += [_path([(left + 24, 88), (left + 24, 54)]), _text(left + 24, 102, "N", "soft", "middle")]
        parts += [_path(on_page[0], "blue"), *_drone(x, y, _YAW_OF_VEHICLE, 0.7)]
        if count:
            parts += [
                _path(on_page[1][:2], "amber", dashed=True, arrow=False),
                _path(on_page[2][1:], "amber", dashed=True),
            ]
            parts += [_dot(*on_page[1][1], "amber")]
        else:
            parts += [_path(on_page[1], "amber", dashed=True)]
    parts += [_path([(16, 336), (46, 336)], "blue"), _text(54, 340, "the vehicle by the AHRS")]
    parts += [
        _path([(250, 336), (280, 336)], "amber", dashed=True),
        _text(288, 340, "the camera's poses as AP_VisualOdom gives them to the filter"),
    ]
    parts += [
        _text(12, 372, "Yaw", "title"),
        _text(12, 422, "Position", "title"),
        _text(12, 472, "Reset", "title"),
        _text(12, 506, "VISO_TYPE 1", "title"),
    ]
    parts += _lines(
        *(122, 372, "VISO_TYPE 2 and 3, at the first pose after the AHRS has a yaw; not while the filter"),
        "takes its yaw from external navigation. Positions, velocities and attitudes are turned.",
    )
    parts += _lines(
        *(122, 422, "VISO_TYPE 2 and 3, with each pose while another source gives the position, if a source"),
        "set names external navigation for it: a switch to the camera makes no jump.",
    )
    parts += [_text(122, 472, "VISO_TYPE 3 aligns both when reset_counter changes, its position with its last one.")]
    parts += [_text(122, 506, "never aligns. The sender has to.")]
    return 524, parts


# The horizon

_STEP_MS: Final = 12.5
_HORIZON_MS: Final = -5 * _STEP_MS
_ARRIVAL_MS: Final = -4.0
_STAMP_MS: Final = -12.0
_DELAY_MS: Final = 18


def _horizon() -> Picture:
    def at(time_ms: float) -> float:
        return 668 + 7.2 * time_ms

    now, then, observed = at(0), at(_HORIZON_MS), at(_STAMP_MS - _DELAY_MS - HALF_FILTER_STEP_MS)
    parts = [_path([(at(-80), 376), (now + 30, 376)])]
    for time_ms in (_HORIZON_MS, -50.0, -37.5, -25.0, -12.5, 0.0):
        parts += [_path([(at(time_ms), 372), (at(time_ms), 380)], arrow=False)]
        parts += [_text(at(time_ms), 396, f"{time_ms:g} ms" if time_ms else "0", "soft", "middle")]
    for x, words, colour in ((then, "fusion horizon", "blue"), (now, "now", "soft")):
        parts += [
            _path([(x, 34), (x, 372)], colour, dashed=True, arrow=False),
            _text(x, 24, words, f"title {colour}", "middle"),
        ]
    # Inertial data
    parts += _lines(12, 56, "inertial data wait", "in steps of", f"{_STEP_MS} ms")
    parts += [_box(at(_HORIZON_MS + _STEP_MS * step) + 2, 50, 7.2 * _STEP_MS - 4, 34) for step in range(5)]
    # A pose
    parts += _lines(12, 124, "a pose of the", "camera")
    parts += [_dot(at(_ARRIVAL_MS), 120, "amber"), _text(at(_ARRIVAL_MS) - 4, 108, "arrives", "", "end")]
    parts += [
        _dot(at(_STAMP_MS), 150, "amber"),
        _text(at(_STAMP_MS) - 10, 146, "stamp after jitter correction", "", "end"),
    ]
    parts += [_path([(at(_ARRIVAL_MS), 120), (at(_ARRIVAL_MS), 150), (at(_STAMP_MS) + 6, 150)], "amber")]
    parts += [
        _path([(at(_STAMP_MS), 150), (at(_STAMP_MS), 184), (observed + 6, 184)], "amber"),
        _dot(observed, 184, "amber"),
    ]
    parts += [_text((at(_STAMP_MS) + observed) / 2, 178, f"VISO_DELAY_MS + {HALF_FILTER_STEP_MS} ms", "", "middle")]
    parts += [_text(observed - 10, 180, "time of observation", "", "end")]
    parts += [_path([(observed, 190), (observed, 216), (then + 6, 216)], "amber", dashed=True)]
    parts += [_text((then + observed) / 2, 210, "waits in its buffer until then", "", "middle")]
    # The filter
    parts += _lines(12, 244, "the filter, EKF3")
    parts += [
        _box(then - 62, 226, 124, 62),
        *_lines(then - 52, 246, "predicts a step,", "then fuses what", "has come due"),
    ]
    # The output
    parts += _lines(12, 322, "what the", "vehicle flies by")
    parts += [_path([(then, 288), (then, 330), (now - 6, 330)], "blue"), _dot(now, 330, "blue")]
    parts += [_text((then + now) / 2, 320, "output predictor: adds the inertial data since the horizon", "", "middle")]
    parts += _lines(
        *(12, 424, f"The horizon is as far back as the slowest sensor is late: {-_HORIZON_MS} ms by default."),
        "A sample that was observed before the horizon counts as observed at the horizon.",
        f"Of two samples that come due in one step the older one is lost ({ekf.SUPERSEDED.code}).",
    )
    return 472, parts


# The filter from inside

_FUSED: Final = "yaw: camera, compass, GPS", "position, velocity, height", "optical flow", "body odometry"


def _filter() -> Picture:
    """The way of a row of inertial data through a core, and where samples of other sensors come in."""
    left, wide, middle = 234, 262, 365
    stages = (
        (40, 40, ("a row of inertial data", "one for each pass: times, then each IMU"), "lanes.py"),
        (104, 40, ("the IMU of the core", "or the one that stands in for it"), "imus.py"),
        (168, 40, ("passes add up to a step", f"of {_STEP_MS} ms, which waits for the horizon"), "inertial.py"),
        (232, 40, ("predict", "the 22 states and their covariance"), "state.py, covariance.py"),
        (296, 92, ("fuse what has come due", *_FUSED), "yaw_fusion.py, vel_pos.py"),
        (424, 40, ("status flags", "and the aiding mode, one pass later"), "flags.py, aiding.py"),
        (488, 40, ("output predictor", "from the horizon to the present"), "output.py"),
    )
    parts = []
    for y, height, (title, *lines), file in stages:
        parts += [_box(left, y, wide, height), _text(left + 10, y + 16, title, "title")]
        parts += _lines(left + 10, y + 33, *lines)
        parts.append(_text(left + wide + 12, y + 16, file, "code soft"))
    for (y, height, *_), (below, *_) in pairwise(stages):
        parts.append(_path([(middle, y + height), (middle, below)]))
    # Samples
    parts += [_box(12, 232, 170, 72), _text(22, 248, "samples", "title")]
    parts += _lines(22, 265, "taken or refused, then", "wait in a buffer for", "the horizon")
    parts += [_text(22, 322, "ext_nav.py, gps.py, ...", "code soft"), _text(22, 338, "samples.py", "code soft")]
    parts.append(_path([(182, 268), (216, 268), (216, 340), (left, 340)], "amber"))
    parts += _lines(
        12, 168, "external navigation, GPS,", "height, compass, flow,", "ranges, body odometry", look="amber"
    )
    parts.append(_path([(97, 206), (97, 232)], "amber"))
    # Present data
    parts.append(_path([(left + wide, 138), (706, 138), (706, 520), (left + wide + 2, 520)], "blue", dashed=True))
    parts.append(_text(700, 484, "inertial data of the present", "blue", "end"))
    # What comes of it
    parts.append(_path([(middle, 528), (middle, 552)], "blue"))
    parts.append(_text(middle, 568, "attitude, velocity and position of now", "blue", "middle"))
    parts.append(_path([(left, 380), (97, 380), (97, 424)], "green"))
    parts += _lines(12, 440, "events: texts, what became of", "each sample (events.py)", look="green")
    return 584, parts


PICTURES: Final[Mapping[str, Callable[[], Picture]]] = {
    "message": _message,
    "frames": _frames,
    "alignment": _alignment,
    "horizon": _horizon,
    "filter": _filter,
}


def drawn() -> Iterator[tuple[str, str]]:
    """Yield the name of each file and its content."""
    for name, make in PICTURES.items():
        picture = make()
        for scheme in _COLOURS:
            yield f"{name}_{scheme}.svg", _svg(picture, scheme)
