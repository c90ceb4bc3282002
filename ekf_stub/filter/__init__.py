# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""State, covariance, prediction, output predictor: no sensors, no parameters by name."""
