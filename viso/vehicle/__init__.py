# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle: wiring, configuration, clock of day, GPS, flow, ranges."""
