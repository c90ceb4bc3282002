# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""AP_DDS: the autopilot's topics and services of ROS 2. Needs the extra ros2."""
