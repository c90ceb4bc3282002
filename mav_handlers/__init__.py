# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""MAVLink endpoint without I/O, and the thin links around it."""
