# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every verdict that a message can get, in one table."""

from typing import Final

import ap_visualodom.verdicts
import mav_handlers.signing.verdicts
import mav_handlers.verdicts
from ap_core.verdict import Verdict

ALL_VERDICTS: Final = tuple(
    value
    for module in (ap_visualodom.verdicts, mav_handlers.verdicts, mav_handlers.signing.verdicts)
    for value in vars(module).values()
    if isinstance(value, Verdict)
)
