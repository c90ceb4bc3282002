# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso explain`: what a text on the ground station or a code of the doctor means, and what to do."""
