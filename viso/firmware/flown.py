# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which release flew in a recording, and which profile stands for it."""

import re
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final

from viso.firmware.releases import DEFAULT, DEVELOPMENT, OFFICIAL, PROFILES, Firmware
from viso.parameters.releases import MAX_LINKS
from viso.parameters.table import make_groups

COPTER: Final = "Copter"
# Up to 3.5 it was APM:Copter V3.5.4, of rovers APMrover2 V3.5.0; of those who build their own, CubeCopter V4.5.7.
_BANNER: Final = re.compile(
    r"\S*?(copter|plane|rover|sub|blimp|tracker)2? +v?(\d+)\.(\d+)([^(]*)(?:\(([0-9a-f]{8})\w*\))?",
    re.IGNORECASE,
)
_STAGES: Final = {0: "-dev", 64: "-alpha", 128: "-beta", 192: "-rc"}
"""By FIRMWARE_VERSION_TYPE, what stands behind the number."""
_LAST_WITHOUT_SOURCES: Final = (4, 0)
_LAST_WITHOUT_QUALITY: Final = (4, 5)
_NAMED_PARAMETERS: Final = 3


@dataclass(frozen=True, slots=True)
class FlownVersion:
    """What a recorded vehicle says that it runs.

    Attributes:
        text: as it introduces itself.
        vehicle: "Copter", "Plane", "Rover", "Sub", "Blimp" or "Tracker"; empty where it does not say.
        major, minor: version numbers.
        source_hash: 8 hex digits of its revision; empty where it does not say.
        is_master: whether it is a master ("-dev"), of which many have the same numbers.
        witness: what says so.
    """

    text: str
    vehicle: str
    major: int
    minor: int
    source_hash: str = ""
    is_master: bool = False
    witness: str = "the banner"

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


@dataclass(frozen=True, slots=True)
class JudgedBy:
    """The release that a recording is judged by.

    Attributes:
        firmware: its profile.
        reason: how it was found, as the end of a sentence.
        notes: in what the release that flew may differ from it, a sentence each.
        stands_for: the release that flew; None if the recording does not name it, or the user names another one.
    """

    firmware: Firmware
    reason: str
    notes: tuple[str, ...] = ()
    stands_for: FlownVersion | None = None

    def __str__(self) -> str:
        """Return which release it is and how it was found, in one line."""
        return f"judged as {self.firmware.name}: {self.reason}"

    def as_dict(self) -> dict[str, str]:
        """Return the release's name and how it was found, for machine-readable output."""
        return {"firmware": self.firmware.name, "firmware_reason": self.reason}


def version_in(text: str, witness: str = "the banner") -> FlownVersion | None:
    """Return the version that a text introduces a vehicle with; None of any other text. ``witness`` is what has it."""
    found = _BANNER.match(text)
    if found is None:
        return None
    vehicle, major, minor, stage, source_hash = found.groups()
    is_master = "-dev" in stage.lower()
    numbers, source_hash = (int(major), int(minor)), (source_hash or "").lower()
    return FlownVersion(text, vehicle.capitalize(), *numbers, source_hash, is_master, witness)


def version_of_number(sw_version: int, source_hash: str, vehicle: str) -> FlownVersion | None:
    """Return the version of AUTOPILOT_VERSION.flight_sw_version; None of 0, which names none."""
    major, minor, patch, kind = sw_version.to_bytes(4, "big")
    if major == 0:
        return None
    stage = "" if kind == OFFICIAL else _STAGES.get(kind, f"-{kind}")
    text = f"Ardu{vehicle or 'Pilot'} V{major}.{minor}.{patch}{stage}"
    return FlownVersion(text, vehicle, major, minor, source_hash, kind == 0, "AUTOPILOT_VERSION")


def profile_for(flown: FlownVersion | None, names: Container[str], given: Firmware | None = None) -> JudgedBy:
    """Return the release to judge a recording by: the one that is given, that flew, or that is nearest to what flew.

    A release is known by its version; a master by its revision, else by which of its parameters other masters do not
    have. The nearest to another one is the next older one, else the oldest.

    Args:
        flown: what flew; None if the recording does not name it.
        names: of the recorded parameters.
        given: the release that the user asks for.
    """
    if given is not None:
        what = "" if flown is None else f"; {flown.witness} says {flown.text}"
        return JudgedBy(given, f"it was asked for{what}", tuple(_notes(flown, given, names)))
    firmware, reason = _of_parameters(names) if flown is None else _of_version(flown, names)
    return JudgedBy(firmware, reason, tuple(_notes(flown, firmware, names)), flown)


def _of_version(flown: FlownVersion, names: Container[str]) -> tuple[Firmware, str]:
    says = f"{flown.witness} says {flown.text}"
    profiles = list(PROFILES.values())
    version = flown.major, flown.minor
    nearest = max((one.version for one in profiles if one.version <= version), default=profiles[0].version)
    fitting = [one for one in profiles if one.version == nearest]
    exact = [one for one in fitting if one.source_hash == flown.source_hash or one.month in flown.text]
    if nearest == version and not flown.is_master:
        exact = exact or [one for one in fitting if one.release_type != DEVELOPMENT]
    if exact:
        return exact[0], says
    if nearest != version or len(fitting) == 1:
        chosen = fitting[0] if version < nearest else fitting[-1]
        return chosen, f"{says}, and {chosen.name} is the nearest that is known here"
    # The oldest that fits: a later one would be known by its parameters.
    chosen = min(fitting, key=lambda one: len(_foreign(one, names)))
    telling = _telling(chosen, fitting, names)
    how = f"it has {telling}" if telling else f"of its masters {chosen.name} is the oldest that is known here"
    return chosen, f"{says}, and {how}"


def _of_parameters(names: Container[str]) -> tuple[Firmware, str]:
    def rank(one: Firmware) -> tuple[int, bool, bool]:
        return len(_foreign(one, names)), one is not DEFAULT, one.release_type == DEVELOPMENT

    chosen = min(PROFILES.values(), key=rank)
    telling = _telling(chosen, PROFILES.values(), names)
    how = f"and has {telling}" if telling else "and this is the default"
    return chosen, f"the recording does not name its release, {how}"


@cache
def _names_of(name: str) -> Mapping[str, None]:
    """Return the names of a release's parameters, in their order."""
    groups = make_groups(MAX_LINKS, None, PROFILES[name].params)
    return dict.fromkeys(slot.name for group in groups for slot in group.slots)


def _foreign(firmware: Firmware, names: Container[str]) -> list[str]:
    """Return recorded names of parameters that a release does not have, but another one does."""
    others = dict.fromkeys(name for one in PROFILES for name in _names_of(one))
    return [name for name in others if name in names and name not in _names_of(firmware.name)]


def _telling(firmware: Firmware, among: Iterable[Firmware], names: Container[str]) -> str:
    """Return a few of the recorded names that a release has and some of the others lack, the rarest first."""
    own = _foreign(firmware, names)
    telling = Counter(name for one in among for name in _foreign(one, names) if name not in own)
    return ", ".join(name for name, _ in telling.most_common(_NAMED_PARAMETERS))


def _notes(flown: FlownVersion | None, firmware: Firmware, names: Container[str]) -> Iterator[str]:
    if flown is None:
        return
    here, there = firmware.version, (flown.major, flown.minor)
    if there < here:
        yield f"{flown.text} is older than {firmware.name}: {'; '.join(_unknown_of(flown))}"
    elif there > here:
        yield f"{flown.text} is newer than {firmware.name}: what changed since is not known here"
    elif flown.is_master and (strange := _foreign(firmware, names)):
        yield (
            f"{flown.text} is no release that is known here: {', '.join(strange[:_NAMED_PARAMETERS])} are not of "
            f"{firmware.name}; what changed between the releases of docs/firmware.md may be as before or as after"
        )
    if flown.vehicle and flown.vehicle != COPTER:
        yield (
            f"the vehicle is a {flown.vehicle}: AP_VisualOdom, EKF3 and what takes the messages are the same in all "
            "vehicles; what is said of arming, modes and the EKF failsafe is Copter's, and so are defaults of "
            "parameters that the recording does not tell"
        )


def _unknown_of(flown: FlownVersion) -> Iterator[str]:
    if not flown.has_sources:
        yield "before 4.1 there are no EK3_SRC1_*, messages go to EKF2 whatever VISO_TYPE is, and no velocity is used"
    elif not flown.reads_quality:
        yield "before 4.6 there is no VISO_QUAL_MIN, and no quality is read"
    yield "what else was otherwise then is not known here"
