# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One flight for all tests of the report."""

import pytest

from tests.unit.viso.report.log_maker import flight, material_of
from viso.report.facts import Facts, facts_of
from viso.report.flight_data import Material

SPITEFUL = "</td><script>alert(1)</script> $x^{2 & \"'"


@pytest.fixture(scope="session")
def material(tmp_path_factory: pytest.TempPathFactory) -> Material:
    """Return the material of a made flight, one of whose texts looks like markup."""
    return material_of(flight(SPITEFUL), tmp_path_factory.mktemp("flight") / "flight.BIN")


@pytest.fixture(scope="session")
def facts(material: Material) -> Facts:
    """Return what is made of it."""
    return facts_of(material)
