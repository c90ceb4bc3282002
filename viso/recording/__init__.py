# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso record`: scenarios, how they are played over a link, and the files that they produce."""
