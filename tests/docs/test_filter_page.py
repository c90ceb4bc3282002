# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of EKF3's sources has a row for each value that a parameter may have, and the text of arming without it."""

import re

from ekf_stub.ahrs.sources import ALLOWED, BEACON, WHEEL_ENCODER, SourceXY, SourceYaw, SourceZ
from tests.places import ROOT
from viso.doctor.checks import CHECKS

NAMES = {"POSXY": SourceXY, "VELXY": SourceXY, "POSZ": SourceZ, "VELZ": SourceZ, "YAW": SourceYaw}
PAGE = (ROOT / "docs" / "filter.md").read_text(encoding="utf-8")


def test_sources_are_those_of_the_code() -> None:
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in PAGE.splitlines() if "`EK3_SRCn_" in line[:12]]
    assert [(name, value, text, here) for name, value, _, text, here, _ in rows] == [
        (
            f"`EK3_SRCn_{what}`",
            f"{int(value)} {NAMES[what](value).name}",
            f"`EK3 sources require {sensor}`" if sensor else "",
            "no" if sensor in (BEACON, WHEEL_ENCODER) else "yes",
        )
        for what, allowed in ALLOWED.items()
        for value, sensor in allowed.items()
    ]


def test_codes_are_those_of_the_doctor() -> None:
    codes = set(re.findall(r"doctor-codes\.md#(xn\w-\d\d)", PAGE))
    assert codes <= {check.code.lower() for check in CHECKS}
