# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Predicted and observed pixels of landmarks and aircraft, and the pose errors that explain the difference.

A diagnostic: nothing here feeds a filter. ``viso.landmarks.inputs`` and ``viso.landmarks.live`` read files and sockets.
"""
