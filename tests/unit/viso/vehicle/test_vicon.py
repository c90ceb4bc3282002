# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera of the firmware's simulator, with the parameters of each release."""

import pytest

from ap_core.param_group import ParamGroup
from ap_core.param_info import ParamInfo
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE
from viso.parameters import sensors
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.vicon import Vicon


def poses(rows: tuple[ParamInfo, ...], **values: float) -> list[VISION_POSITION_ESTIMATE]:
    """Return the poses of ten seconds of a vehicle that stands still."""
    params, reader = ParamGroup("SIM_VICON_", rows), Codec(0, 0)
    for name, value in values.items():
        params.set(name, value)
    camera, seen = Vicon(Airframe(0.0), params), []
    for now_us in range(0, 10_000_000, 2_500):
        reader.feed(camera.update(now_us))
        while (one := reader.next_received()) is not None:
            if isinstance(one, Received) and isinstance(one.message, VISION_POSITION_ESTIMATE):
                seen.append(one.message)
    return seen


@pytest.mark.parametrize("rows", [sensors.VICON, sensors.VICON_WITH_QUALITY], ids=["2025-07", "2026-02"])
def test_camera_of_4_6_is_that_of_later_ones_with_their_defaults(rows: tuple[ParamInfo, ...]) -> None:
    of_4_6 = poses(sensors.VICON_IN_4_6)
    assert len(of_4_6) > 50
    assert of_4_6 == poses(rows)


def test_later_cameras_may_be_slower_and_noisy() -> None:
    usual, noisy = poses(sensors.VICON), poses(sensors.VICON, RATE=10, P_SD=0.5)
    assert len(noisy) < len(usual)
    assert {pose.x for pose in usual} == {0.0}
    assert len({pose.x for pose in noisy}) > 10
