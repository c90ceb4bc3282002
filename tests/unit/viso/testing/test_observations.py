# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a test observes of the log."""

import pytest

from viso.testing.observations import Record


def test_record_says_which_fields_it_has() -> None:
    record = Record(5, "VISP", {"PX": 1})
    assert "PX" in record
    assert "PY" not in record
    assert 0 not in record
    assert record["PX"] == 1
    with pytest.raises(KeyError):
        record["PY"]
