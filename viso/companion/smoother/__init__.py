# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The fixed-lag smoother: it estimates the last seconds together. Needs the extra gtsam."""
