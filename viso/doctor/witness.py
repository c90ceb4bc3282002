# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a finding rests on."""

from enum import StrEnum


class Witness(StrEnum):
    """What a finding rests on.

    LOG: what the vehicle that really flew wrote down itself. TELEMETRY: what it sent meanwhile. STREAM: what the
    companion sent, and what the port and the endpoint, which are exact, do with it. MODEL: what a model of the filter
    makes of it.
    """

    LOG = "log"
    TELEMETRY = "vehicle telemetry"
    STREAM = "stream"
    MODEL = "model"
