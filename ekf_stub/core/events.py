# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a core has to say: texts for the ground station, and what became of samples of external navigation.

A core says it in numbers; `ekf_stub.reports` and `ekf_stub.inputs.ingest_rules` put it into words.
"""

from typing import Final, final

from ekf_stub.core.vectors import ZERO, Vec3

# Texts
TILT_ALIGNED: Final = 0
ORIGIN_SET: Final = 1
INITIALISED: Final = 2
FORCED_RESET: Final = 3
STOPPED_AIDING: Final = 4
STARTED_RELATIVE: Final = 5
USING_GPS: Final = 6
USING_EXT_NAV: Final = 7
INITIAL_POS: Final = 8
INITIAL_VEL: Final = 9
FUSING_ODOMETRY: Final = 10
FUSING_FLOW: Final = 11
SWITCHING_COMPASS: Final = 12
YAW_ALIGNED: Final = 13
YAW_ALIGNED_TO_GPS: Final = 14
YAW_ALIGNED_USING_GPS: Final = 15
EMERGENCY_YAW_RESET: Final = 16
MAG_INITIAL: Final = 17
MAG_IN_FLIGHT: Final = 18
MAG_ANOMALY: Final = 19
LANE_SWITCH: Final = 20  # of all cores
ORIGIN_ALREADY_SET: Final = 21  # of all cores

# Kinds of samples
POSE: Final = 0
HEIGHT: Final = 1  # of a pose
YAW: Final = 2
VELOCITY: Final = 3
ODOMETRY: Final = 4

# Rules that decide what becomes of them
TAKEN: Final = 0
NOT_STARTED: Final = 1
NOT_A_NUMBER: Final = 2
YAW_NOT_A_NUMBER: Final = 3
TOO_SOON: Final = 4
TOO_SHORT: Final = 5
NOT_INITIALISED: Final = 6
NO_BUFFER: Final = 7
OVERWRITTEN: Final = 8
SUPERSEDED: Final = 9
TOO_OLD: Final = 10
NOT_FINITE: Final = 11
UNUSED: Final = 12
FUSED: Final = 13
RESET_TO: Final = 14
ALIGNED_TO: Final = 15
GATE_POSITION: Final = 16
GATE_VELOCITY: Final = 17
GATE_HEIGHT: Final = 18
GATE_YAW: Final = 19
GATE_ODOMETRY: Final = 20

UNTESTED: Final = -1.0


@final
class Text:
    """A text: of a core by its number, or of all by -1; which one, and the numbers in it."""

    def __init__(self, core: int, code: int, values: Vec3) -> None:
        self.core = core
        self.code = code
        self.values = values


@final
class SampleOutcome:
    """What became of a sample.

    Attributes:
        kind, rule: as above.
        time_ms: when it was observed, in ms since boot, modulo 2^32.
        ratio: of its innovation to the gate; UNTESTED where it was not tested.
        innovation: the length of its innovation in m, rad or m/s, of a pose horizontal; UNTESTED likewise.
    """

    def __init__(self, kind: int, rule: int, time_ms: int, ratio: float, innovation: float) -> None:
        self.kind = kind
        self.rule = rule
        self.time_ms = time_ms
        self.ratio = ratio
        self.innovation = innovation


@final
class Events:
    """What has been said and is not yet told.

    ``texts`` are of all cores, ``outcomes`` of one.
    """

    def __init__(self, core: int, texts: list[Text]) -> None:
        self._core = core
        self.texts = texts
        self.outcomes: list[SampleOutcome] = []

    def say(self, code: int, values: Vec3 = ZERO) -> None:
        """Say a text."""
        self.texts.append(Text(self._core, code, values))

    def tell(self, kind: int, rule: int, time_ms: int, ratio: float = UNTESTED, innovation: float = UNTESTED) -> None:
        """Tell what became of a sample."""
        self.outcomes.append(SampleOutcome(kind, rule, time_ms, ratio, innovation))
