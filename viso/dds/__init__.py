# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS 2 without ROS: messages over DDS by cyclonedds (the extra ``ros2``), and the autopilot's topics (AP_DDS)."""
