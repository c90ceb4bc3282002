# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of an autopilot held against viso, field by field; the tolerances are in ``viso.comparing.rules``."""
