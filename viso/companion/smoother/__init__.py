# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The fixed-lag smoother: all of the last seconds estimated together. Needs the extra gtsam."""
