# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where landmarks and aircraft should appear in the camera, and what the difference says about the pose.

A diagnostic: nothing here feeds a filter. ``viso.landmarks.inputs`` and ``viso.landmarks.live`` read files and sockets.
"""
