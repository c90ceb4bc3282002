# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules by which frames are refused for their signature, and keys for their time."""

from collections.abc import Mapping
from typing import Final

from ap_core.verdict import Verdict, dropped
from mav_handlers.wire.signature import Refusal

_CHECK: Final = "mavlink_helpers.h, mavlink_signature_check"
_SETUP: Final = "GCS_Signing.cpp, GCS_MAVLINK::handle_setup_signing"

UNSIGNED: Final = dropped(
    "unsigned", "a key is set and the frame is not signed", "GCS_Signing.cpp, accept_unsigned_callback"
)
BAD_SIGNATURE: Final = dropped("bad_signature", "signed with another key, or changed since", _CHECK)
SIGNATURE_REPLAYED: Final = dropped(
    "signature_replayed", "the sender has used this timestamp or a later one before", _CHECK
)
SIGNATURE_OLD: Final = dropped(
    "signature_old", "a new sender's timestamp is more than a minute behind the link's", _CHECK
)
SIGNATURE_STREAMS: Final = dropped("signature_streams", "16 other senders have signed frames already", _CHECK)
SETUP_WHILE_ARMED: Final = dropped("signing_armed", "a signing key is not accepted while armed", _SETUP)
KEY_NOT_SAVED: Final = dropped("signing_not_saved", "the signing key could not be stored", _SETUP)

_BY_REFUSAL: Final[Mapping[str, Verdict]] = {
    Refusal.UNSIGNED: UNSIGNED,
    Refusal.BAD_SIGNATURE: BAD_SIGNATURE,
    Refusal.REPLAYED: SIGNATURE_REPLAYED,
    Refusal.OLD_TIMESTAMP: SIGNATURE_OLD,
    Refusal.TOO_MANY_STREAMS: SIGNATURE_STREAMS,
}


def signing_verdict(reason: str) -> Verdict | None:
    """Return the verdict on a frame refused for its signature, from ``BadData.reason``; None for other reasons."""
    return _BY_REFUSAL.get(reason)
