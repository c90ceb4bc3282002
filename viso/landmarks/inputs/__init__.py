# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where poses, landmarks, detections and aircraft come from: files, lines, bags and messages.

Every reader yields records of ``viso.landmarks.types`` in the order of arrival, and counts in ``refused``
what it could not use, by reason. Data never make a reader raise; a file that cannot be read at all does, in one line.
"""
