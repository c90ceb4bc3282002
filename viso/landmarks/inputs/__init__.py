# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Readers of poses, landmarks, detections and aircraft from files, lines, bags and messages.

Every reader yields records of ``viso.landmarks.types`` in the order of arrival, and counts unusable ones in ``refused``
by reason. Data never make a reader raise; a file that cannot be read at all does, in one line.
"""
