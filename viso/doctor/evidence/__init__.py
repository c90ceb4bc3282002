# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is gathered for a diagnosis: the stream, the vehicle, the trial, and what was measured of them."""
