# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers taken from a stream and from the vehicle; nothing here knows a rule."""
