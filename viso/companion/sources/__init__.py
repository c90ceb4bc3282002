# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where frames and inertial data come from: recordings of several kinds, a synthetic flight, a camera."""
