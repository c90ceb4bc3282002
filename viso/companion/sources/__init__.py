# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources of frames and inertial data: recordings of several kinds, a synthetic flight, a camera."""
