# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a command line asks for, made into values: firmware, parameters, presets, AHRS."""
