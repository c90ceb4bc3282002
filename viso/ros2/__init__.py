# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS 2 without ROS: its messages, topic names and QoS over DDS, through cyclonedds (the extra ``ros2``)."""
