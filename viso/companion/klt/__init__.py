# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The front end: from pictures to tracked points that agree with the motion of a rigid scene. Needs the extra vio."""
