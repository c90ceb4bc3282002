# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a running autopilot: scenarios, who plays them over a link, and the files that come of it."""
