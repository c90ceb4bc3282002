# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pose predicts: that of the odometry, or one that stands at an estimated position."""

from dataclasses import dataclass, replace

from viso.companion.landmarks.local_frame import FrameMode, to_enu
from viso.companion.landmarks.types import EstimatedPosition, GeodeticPoint, GlobalFix, VehiclePose

ODOMETRY_LABEL = "odom"
ESTIMATED_LABEL = "estimated"


@dataclass(frozen=True, slots=True)
class ChosenPose:
    """The pose that predicts.

    Attributes:
        pose: the odometry's very object, if that predicts.
        label: which one it is.
    """

    pose: VehiclePose
    label: str

    @property
    def is_estimated(self) -> bool:
        """Whether it stands at an estimated position."""
        return self.label == ESTIMATED_LABEL


def reference_of(reference: GeodeticPoint | None, fix: GlobalFix) -> GeodeticPoint | None:
    """Return the reference after one more fix: the first real one, for good."""
    if reference is not None:
        return reference
    return fix.point if fix.point.is_fix else None


def choose_pose(
    odometry: VehiclePose,
    source: str = "",
    estimated: EstimatedPosition | None = None,
    reference: GeodeticPoint | None = None,
    mode: FrameMode = FrameMode.WGS84,
) -> ChosenPose:
    """Return the pose that predicts.

    The estimated one has east and north of the position, counted from the reference; the rest is the odometry's.

    Args:
        odometry: the vehicle's pose.
        source: name of what tells estimated positions; empty means odometry whatever else is known.
        estimated: the last one; (0, 0) is none.
        reference: the first global fix.
        mode: of the local frame.
    """
    if not source or estimated is None or reference is None or not estimated.point.is_fix:
        return ChosenPose(odometry, ODOMETRY_LABEL)
    place = estimated.point
    enu = to_enu(mode, reference, place.latitude_deg, place.longitude_deg, reference.alt_m)
    x_m, y_m, _ = enu.tolist()
    return ChosenPose(replace(odometry, x_m=x_m, y_m=y_m), ESTIMATED_LABEL)
