# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A model of the flight controller: what a multicopter does in its modes, steered by its own estimate."""
