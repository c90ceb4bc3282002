# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pytest plugin: fixtures that are the autopilot for tests of a companion computer.

Whoever has this project installed has the plugin loaded; nothing heavy is imported until a test asks for a fixture.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final, TypeVar

import pytest

if TYPE_CHECKING:
    from viso.testing import Autopilot, AutopilotOptions, UdpAutopilot
    from viso.testing.golden import GoldenFiles

MARKER: Final = "extnav_autopilot"
OPTION_NAMES: Final = ("params", "preset", "imu", "firmware", "vision", "home")
UPDATE_GOLDEN: Final = "update_golden"

_A = TypeVar("_A", bound="Autopilot")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--update-golden``."""
    group = parser.getgroup("viso", "external navigation")
    group.addoption(
        "--update-golden",
        action="store_true",
        dest=UPDATE_GOLDEN,
        help="write the golden logs of assert_golden again",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known."""
    arguments = ", ".join(f"{name}=..." for name in OPTION_NAMES)
    config.addinivalue_line(
        "markers", f"{MARKER}({arguments}): what autopilot the fixtures extnav_autopilot and extnav_autopilot_udp are"
    )


@pytest.fixture
def extnav_autopilot(request: pytest.FixtureRequest) -> "Iterator[Autopilot]":
    """The emulated autopilot, booted, in virtual time: see ``viso.testing.Autopilot``."""
    from viso.testing import Autopilot

    yield from _made(request, Autopilot)


@pytest.fixture
def extnav_autopilot_udp(request: pytest.FixtureRequest) -> "Iterator[UdpAutopilot]":
    """The same on a UDP port of loopback: see ``viso.testing.UdpAutopilot``."""
    from viso.testing import UdpAutopilot

    yield from _made(request, UdpAutopilot)


def _made(request: pytest.FixtureRequest, make: "Callable[[AutopilotOptions, GoldenFiles], _A]") -> "Iterator[_A]":
    from viso.testing.golden import FOLDER, GoldenFiles

    golden = GoldenFiles(request.path.parent / FOLDER, update=request.config.getoption(UPDATE_GOLDEN))
    reason = ""
    try:
        autopilot = make(_wanted(request.node), golden)
    except ValueError as error:
        reason = f"{MARKER}: {error}"
    if reason:  # told outside, where pytest does not show the first error as well
        pytest.fail(reason, pytrace=False)
    try:
        yield autopilot
    finally:
        autopilot.close()


def _wanted(item: pytest.Item) -> "AutopilotOptions":
    """Return the options of a test: of its markers the nearest one wins, parameter by parameter.

    Raises ValueError: a marker has an argument that there is not.
    """
    from viso.testing import AutopilotOptions

    values: dict[str, Any] = {}
    params: dict[str, float] = {}
    for marker in reversed(list(item.iter_markers(MARKER))):
        unknown = [repr(value) for value in marker.args] + [name for name in marker.kwargs if name not in OPTION_NAMES]
        if unknown:
            raise ValueError(f"the marker takes {', '.join(OPTION_NAMES)}, by name, and not {', '.join(unknown)}")
        own = marker.kwargs.get("params", {})
        if not isinstance(own, Mapping):
            raise ValueError(f"params is {own!r}, not a mapping of names to numbers")
        values.update(marker.kwargs)
        params.update(own)
    return AutopilotOptions(**{**values, "params": params})
