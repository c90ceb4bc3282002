# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The texts that introduce a vehicle (GCS_MAVLINK_Copter::send_banner, AP_Motors::get_frame_and_type_string)."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from ap_core.param import ParamTable
from mav_handlers.senders.status import system_text
from viso.firmware.releases import Firmware

_QUAD_TYPES: Final[Mapping[int, str]] = MappingProxyType(
    {
        0: "PLUS",
        1: "X",
        2: "V",
        3: "H",
        4: "VTAIL",
        5: "ATAIL",
        6: "PLUSREV",
        12: "BF_X",
        13: "DJI_X",
        14: "CW_X",
        16: "NYT_PLUS",
        17: "NYT_X",
        18: "X_REV",
        19: "Y4",
    }
)
"""Names of FRAME_TYPE in texts, of a quad (AP_MotorsMatrix::setup_quad_matrix)."""


def banner(firmware: Firmware, params: ParamTable) -> tuple[str, ...]:
    """Return the firmware's text, the system's id and the frame.

    FIRMWARE PARITY: whatever FRAME_CLASS says, it is a quad.
    """
    system_id = params.get_int(firmware.endpoint.params.system_id)
    kind = _QUAD_TYPES.get(params.get_int("FRAME_TYPE"))
    frame = "Frame: QUAD" if kind is None else f"Frame: QUAD/{kind}"
    return firmware.banner, system_text(system_id), frame
