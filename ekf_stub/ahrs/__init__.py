# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""AHRS facades: the vehicle's questions to the estimator."""
