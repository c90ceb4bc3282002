# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of sources, one row each, and which of them a name means."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

from viso.companion.sources.base import Recording, SourceError, SourceOptions, body_rotation
from viso.companion.sources.camera import LiveCamera, open_camera, sounds_like_camera
from viso.companion.sources.gopro import has_telemetry
from viso.companion.sources.recordings import SYNTHETIC, open_euroc, open_gopro, open_synthetic, open_video


@dataclass(frozen=True, slots=True)
class SourceKind:
    """A kind of source: what opens one (it raises SourceError), whether a name means one, and its IMU's usual axes."""

    open: Callable[[SourceOptions], Recording | LiveCamera]
    fits: Callable[[str], bool]
    summary: str
    axes: str = "FLU"


SOURCES: Final[Mapping[str, SourceKind]] = MappingProxyType(
    {
        "synthetic": SourceKind(
            open_synthetic,
            lambda name: name.partition(":")[0] == SYNTHETIC,
            "a flight over generated ground, `synthetic` or `synthetic:SEED`",
        ),
        "camera": SourceKind(
            open_camera, sounds_like_camera, "a camera by its number or URL, with the IMU of the autopilot (--master)"
        ),
        "euroc": SourceKind(
            open_euroc, lambda name: Path(name).is_dir(), "a folder in the layout of the EuRoC data sets", "URF"
        ),
        "gopro": SourceKind(
            open_gopro, lambda name: has_telemetry(Path(name)), "a GoPro's .mp4 with its telemetry inside"
        ),
        "video": SourceKind(open_video, lambda name: True, "any video, with inertial data in a csv file (--imu)"),
    }
)


def kind_of(name: str) -> str:
    """Return the kind of source that a name means."""
    return next(kind for kind, row in SOURCES.items() if row.fits(name))


def open_source(options: SourceOptions, kind: str | None = None) -> Recording | LiveCamera:
    """Open a source of a kind of ``SOURCES``, or, for None, of the one that it is. Raises SourceError if it cannot."""
    kind = kind or kind_of(options.name)
    if kind not in SOURCES:
        raise SourceError(f"no source {kind!r}; there are {', '.join(SOURCES)}")
    row = SOURCES[kind]
    try:
        body_R_imu = body_rotation(options.imu_axes or row.axes, options.mounting)
    except ValueError as error:
        raise SourceError(f"axes of the IMU: {error}") from error
    source = row.open(options)
    return source.turned(body_R_imu) if isinstance(source, Recording) else source
