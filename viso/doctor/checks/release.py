# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN5: how a release of the firmware uses covariances."""

import math
from array import array
from collections.abc import Iterator
from typing import Final

from ap_visualodom.ap_visualodom_backend import ANG_ERR_MAX_RAD, POS_ERR_MAX_M
from mav_handlers.covariance import pose_errors
from mav_handlers.wire.messages import ATT_POS_MOCAP
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import by_type, share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.tracks import covariance_of
from viso.firmware.changes import ERROR_FORMULA, MOCAP_ERRORS
from viso.firmware.releases import PROFILES, Firmware
from viso.streams.stream_kinds import Aspect

_NEEDS: Final = frozenset({Aspect.COVARIANCE})

Errors = tuple[float, float]
"""Of position (m) and of attitude (rad), as the filter gets them."""


class _ErrorsByRelease:
    """The errors that releases compute from covariances; a stream usually repeats a few, so that results are kept."""

    def __init__(self, evidence: Evidence) -> None:
        self._floors = evidence.param("VISO_POS_M_NSE"), evidence.param("VISO_YAW_M_NSE")
        self._known: dict[tuple[str, bool, bytes], Errors] = {}

    def raw(self, message: object, firmware: Firmware) -> Errors | None:
        """Return both errors before they are limited; None for a message without a covariance."""
        covariance = covariance_of(message)
        if covariance is None or math.isnan(covariance[0]) or not any(covariance):
            return None
        key = firmware.name, isinstance(message, ATT_POS_MOCAP), array("d", covariance).tobytes()  # NaN equals no NaN
        if key not in self._known:
            release = firmware.endpoint
            make = release.mocap_errors if key[1] else pose_errors
            pos, ang = make(covariance, release.error_formula)
            self._known[key] = float(pos), float(ang)
        return self._known[key]

    def limited(self, message: object, firmware: Firmware) -> Errors | None:
        """Return both errors as the filter gets them; NaN becomes the midpoint."""
        errors = self.raw(message, firmware)
        if errors is None:
            return None
        limits = zip(errors, self._floors, (POS_ERR_MAX_M, ANG_ERR_MAX_RAD), strict=True)
        pos, ang = (_limited(error, floor, float(most)) for error, floor, most in limits)
        return pos, ang


def _limited(error: float, floor: float, most: float) -> float:
    return (floor + most) / 2 if math.isnan(error) else max(floor, min(error, most))


def _errors_text(errors: Errors) -> str:
    return f"{errors[0]:.3g} m, {errors[1]:.3g} rad"


@check(
    code="XN5-31",
    severity=Severity.NOTE,
    title="Errors depend on the release",
    firmware=(
        "Up to 4.6 an error is the cube root of the sum of squared variances, since 4.7 the root of their sum "
        f"(master's {ERROR_FORMULA.source}). The filter weighs samples by it."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_odometry",
    fix="Name the release that flies with --firmware, and tune variances for it; replay --versus shows both.",
    needs=_NEEDS,
)
def errors_of_releases(evidence: Evidence) -> Iterator[Sighting]:
    errors_by, here = _ErrorsByRelease(evidence), evidence.set_up.firmware
    others = [one for one in PROFILES.values() if one.endpoint.error_formula is not here.endpoint.error_formula]
    for other in {one.endpoint.error_formula: one for one in others}.values():  # the newest with each formula
        differ = [one for one in evidence.stream.vision if not _agree(errors_by, one.message, here, other)]
        for name, found in by_type(differ):
            ours, theirs = (errors_by.limited(found[0].message, one) for one in (here, other))
            if ours is not None and theirs is not None:
                whole = sum(one.name == name for one in evidence.stream.vision)
                texts = f"{_errors_text(ours)} here ({here.name}), {_errors_text(theirs)} in {other.name}"
                yield Sighting.in_messages(f"{share(len(found), whole)} {name}, first: {texts}", found)


def _agree(errors_by: _ErrorsByRelease, message: object, here: Firmware, other: Firmware) -> bool:
    if isinstance(message, ATT_POS_MOCAP):  # has a check of its own
        return True
    ours, theirs = errors_by.limited(message, here), errors_by.limited(message, other)
    if ours is None or theirs is None:
        return True
    return all(math.isclose(a, b, rel_tol=0.01) for a, b in zip(ours, theirs, strict=True))


@check(
    code="XN5-32",
    severity=Severity.NOTE,
    title="This release does not read the covariance of motion capture",
    firmware=(
        "Up to 4.6 the errors of ATT_POS_MOCAP are 0, raised to the floors; since 4.7 its covariance is read "
        f"(master's {MOCAP_ERRORS.source})."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_att_pos_mocap",
    fix="Set VISO_POS_M_NSE and VISO_YAW_M_NSE to the accuracy of the source, or send ODOMETRY.",
    needs=_NEEDS,
)
def mocap_covariance(evidence: Evidence) -> Iterator[Sighting]:
    errors_by, here = _ErrorsByRelease(evidence), evidence.set_up.firmware
    readers = [one for one in PROFILES.values() if one.endpoint.mocap_errors is not here.endpoint.mocap_errors]
    found = [one for one in evidence.stream.vision if isinstance(one.message, ATT_POS_MOCAP)]
    given = [one for one in found if errors_by.raw(one.message, here) == (0.0, 0.0)]
    if given and readers:
        theirs = errors_by.limited(given[0].message, readers[0])
        if theirs is not None:
            text = (
                f"{share(len(given), len(found))} ATT_POS_MOCAP have a covariance, which {readers[0].name} would read"
            )
            yield Sighting.in_messages(f"{text}: {_errors_text(theirs)} of the first", given)


@check(
    code="XN5-33",
    severity=Severity.ERROR,
    title="Variances whose sum is negative",
    firmware=(
        "This release takes the root of the sum, which is NaN. It turns NaN into half the limit (50.1 m, 0.85 rad) and "
        "the internal error 0x400: arming is refused until reboot."
    ),
    source="AP_Math.cpp, constrain_value_line",
    fix="Variances are never negative: send them squared, or a first element of NaN.",
    needs=_NEEDS,
)
def negative_variances(evidence: Evidence) -> Iterator[Sighting]:
    errors_by, here = _ErrorsByRelease(evidence), evidence.set_up.firmware
    found = [one for one in evidence.stream.vision if _has_negative_sum(errors_by, one.message, here)]
    for name, messages in by_type(found):
        whole = sum(one.name == name for one in evidence.stream.vision)
        yield Sighting.in_messages(f"{share(len(messages), whole)} {name}", messages)


def _has_negative_sum(errors_by: _ErrorsByRelease, message: object, firmware: Firmware) -> bool:
    errors, covariance = errors_by.raw(message, firmware), covariance_of(message)
    # NaN from NaN is another finding.
    return errors is not None and any(map(math.isnan, errors)) and not any(map(math.isnan, covariance or ()))
