# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pose predicts: that of the odometry, or one that stands at an estimated position."""

from dataclasses import replace

from viso.companion.landmarks.local_frame import FrameMode, to_enu
from viso.companion.landmarks.types import EstimatedPosition, GeodeticPoint, VehiclePose


def choose_pose(
    odometry: VehiclePose,
    source: str = "",
    estimated: EstimatedPosition | None = None,
    reference: GeodeticPoint | None = None,
    mode: FrameMode = FrameMode.WGS84,
) -> VehiclePose:
    """Return the pose that predicts: the odometry's very object, if that does.

    The estimated one has east and north of the position, counted from the reference; the rest is the odometry's.

    Args:
        odometry: the vehicle's pose.
        source: name of what tells estimated positions; empty means odometry whatever else is known.
        estimated: the last one; (0, 0) is none.
        reference: the first global fix.
        mode: of the local frame.
    """
    if not source or estimated is None or reference is None or not estimated.point.is_fix:
        return odometry
    place = estimated.point
    enu = to_enu(mode, reference, place.latitude_deg, place.longitude_deg, reference.alt_m)
    x_m, y_m, _ = enu.tolist()
    return replace(odometry, x_m=x_m, y_m=y_m)
