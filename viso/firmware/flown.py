# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which release flew in a recording, and which profile stands for it."""

import re
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from viso.firmware.releases import DEFAULT, PROFILES, Firmware

COPTER: Final = "Copter"
# Up to 3.5 it was APM:Copter V3.5.4, of rovers APMrover2 V3.5.0; of those who build their own, CubeCopter V4.5.7.
_BANNER: Final = re.compile(
    r"\S*?(copter|plane|rover|sub|blimp|tracker)2? +v?(\d+)\.(\d+)[^(]*(?:\(([0-9a-f]{8})\w*\))?",
    re.IGNORECASE,
)
_LAST_WITHOUT_SOURCES: Final = (4, 0)
_LAST_WITHOUT_QUALITY: Final = (4, 5)


@dataclass(frozen=True, slots=True)
class FlownVersion:
    """What a recorded vehicle says that it runs.

    Attributes:
        text: as it introduces itself.
        vehicle: "Copter", "Plane", "Rover", "Sub", "Blimp" or "Tracker"; empty where it does not say.
        major, minor: version numbers.
        source_hash: 8 hex digits of its revision; empty where it does not say.
    """

    text: str
    vehicle: str
    major: int
    minor: int
    source_hash: str = ""

    @property
    def has_sources(self) -> bool:
        """Whether EK3_SRC1_* choose what EKF3 uses, and VISO_TYPE decides who takes messages: since 4.1.

        Before, messages went to the estimators whatever VISO_TYPE was, and EKF2 alone used them.
        """
        return (self.major, self.minor) > _LAST_WITHOUT_SOURCES

    @property
    def reads_quality(self) -> bool:
        """Whether messages' qualities are read, and VISO_QUAL_MIN is there: since 4.6."""
        return (self.major, self.minor) > _LAST_WITHOUT_QUALITY


def version_in(text: str) -> FlownVersion | None:
    """Return the version that a text introduces a vehicle with; None of any other text."""
    found = _BANNER.match(text)
    if found is None:
        return None
    vehicle, major, minor, source_hash = found.groups()
    return FlownVersion(text, vehicle.capitalize(), int(major), int(minor), (source_hash or "").lower())


def version_of_number(sw_version: int, source_hash: str, vehicle: str) -> FlownVersion | None:
    """Return the version of AUTOPILOT_VERSION.flight_sw_version; None of 0, which tells none."""
    major, minor, patch = sw_version >> 24 & 0xFF, sw_version >> 16 & 0xFF, sw_version >> 8 & 0xFF
    if major == 0:
        return None
    return FlownVersion(f"Ardu{vehicle or 'Pilot'} V{major}.{minor}.{patch}", vehicle, major, minor, source_hash)


def profile_for(flown: FlownVersion | None, names: Container[str]) -> Firmware:
    """Return the profile that is nearest to what flew: its own, else the next older one, else the oldest.

    Args:
        flown: what flew; the reference stands for what is not known.
        names: of its parameters, which tell masters of one version apart.
    """
    if flown is None:
        return DEFAULT
    profiles = list(PROFILES.values())
    numbers = [(one.major, one.minor) for one in profiles]
    version = flown.major, flown.minor
    nearest = max((number for number in numbers if number <= version), default=numbers[0])
    fitting = [one for one, number in zip(profiles, numbers, strict=True) if number == nearest]
    by_hash = [one for one in fitting if one.source_hash == flown.source_hash]
    by_name = [one for one in fitting if f"ARMING_{one.params.arming_check}" in names]
    newest = fitting if version == nearest else fitting[::-1]
    return (by_hash or by_name or newest)[0]


def notes_on(flown: FlownVersion | None, firmware: Firmware) -> Iterator[str]:
    """Yield in what a recording's release may differ from the profile that stands for it, a sentence each."""
    if flown is None:
        return
    note = f"the recording is of {flown.text}, and judged as {firmware.version_text} (--firmware {firmware.name})"
    here, there = (firmware.major, firmware.minor), (flown.major, flown.minor)
    if there < here:
        yield f"{note}: {'; '.join(_unknown_of(flown))}"
    elif there > here:
        yield f"{note}: what changed since is not known here"
    if flown.vehicle and flown.vehicle != COPTER:
        yield (
            f"the vehicle is a {flown.vehicle}: AP_VisualOdom, EKF3 and what takes the messages are the same in all "
            "vehicles; what is said of arming, modes and the EKF failsafe is Copter's, and so are defaults of "
            "parameters that the recording does not tell"
        )


def _unknown_of(flown: FlownVersion) -> Iterable[str]:
    if not flown.has_sources:
        yield "before 4.1 there are no EK3_SRC1_*, messages go to EKF2 whatever VISO_TYPE is, and no velocity is used"
    elif not flown.reads_quality:
        yield "before 4.6 there is no VISO_QUAL_MIN, and no quality is read"
    yield "what else was otherwise then is not known here"
