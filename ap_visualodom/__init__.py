# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Port of ArduPilot's AP_VisualOdom library."""

from ap_visualodom.ap_visualodom import BACKENDS, AP_VisualOdom
from ap_visualodom.ap_visualodom_backend import AP_VisualOdom_Backend
from ap_visualodom.ports import Ahrs
from ap_visualodom.var_info import VisualOdom_Type

__all__ = ["BACKENDS", "AP_VisualOdom", "AP_VisualOdom_Backend", "Ahrs", "VisualOdom_Type"]
