# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every verdict that a message can meet, in one table."""

from typing import Final

from ap_visualodom.verdicts import VERDICTS as VISUALODOM_VERDICTS
from mav_handlers.signing.verdicts import SIGNING_VERDICTS
from mav_handlers.transfers.log_transfer_verdicts import VERDICTS as LOG_TRANSFER_VERDICTS
from mav_handlers.verdicts import VERDICTS as ENDPOINT_VERDICTS

ALL_VERDICTS: Final = (*VISUALODOM_VERDICTS, *ENDPOINT_VERDICTS, *LOG_TRANSFER_VERDICTS, *SIGNING_VERDICTS)
