# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""MAVLink messages as typed dataclasses, and the codec that speaks pymavlink."""
