# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The bridge, and the autopilot at its other end: in the same process, and over UDP."""

from collections.abc import Iterator

import pytest
from kestrel_bridge import Bridge, UdpPort

from viso.testing import Autopilot, UdpAutopilot


@pytest.fixture(params=["extnav_autopilot", "extnav_autopilot_udp"])
def autopilot(request: pytest.FixtureRequest) -> Autopilot:
    """Return the autopilot; every test runs with both kinds."""
    made: Autopilot = request.getfixturevalue(request.param)
    return made


@pytest.fixture
def unconnected(autopilot: Autopilot) -> Iterator[Bridge]:
    """Return a bridge that has not heard of the autopilot."""
    if isinstance(autopilot, UdpAutopilot):
        with UdpPort(autopilot.address) as port:
            yield Bridge(port)
    else:
        yield Bridge(autopilot)


@pytest.fixture
def bridge(autopilot: Autopilot, unconnected: Bridge) -> Bridge:
    """Return a bridge that has heard the autopilot."""
    unconnected.greet()
    autopilot.advance(s=0.6)  # the autopilot's heartbeat comes once a second
    unconnected.listen()
    assert unconnected.autopilot_heard
    return unconnected
