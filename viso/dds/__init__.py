# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot's topics and services of ROS 2, as AP_DDS has them. Needs the extra ros2."""
