# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of a running vehicle as a mapping that can be written."""

from collections.abc import Iterator, Mapping

from ap_core.param import ParamOutcome
from viso.parameters.conversion import name_here
from viso.parameters.releases import ALL_RENAMES
from viso.vehicle.vehicle import Vehicle

__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is


class LiveParams(Mapping[str, float]):
    """The parameters of a vehicle by name; those it lists at the moment when iterated over.

    To set one does what a PARAM_SET of a ground station does: it is kept, logged and echoed, and what takes effect at
    boot alone does not take effect.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    def __getitem__(self, name: str) -> float:
        """Return a value; KeyError if there is no such parameter."""
        found = self._vehicle.params.find(name)
        if found is None:
            raise KeyError(self._unknown(name))
        return float(found.value)

    def __setitem__(self, name: str, value: float) -> None:
        """Set a value at once.

        Raises:
            KeyError: there is no such parameter.
            ValueError: the value is not finite, or the parameter is read-only.
        """
        vehicle = self._vehicle
        result = vehicle.params.set_from_mavlink(name, value)
        if result.outcome is ParamOutcome.UNKNOWN:
            raise KeyError(self._unknown(name))
        if result.outcome is not ParamOutcome.SET:
            why = "read-only" if result.outcome is ParamOutcome.READ_ONLY else f"{value} is not finite"
            raise ValueError(f"{name}: {why}")
        vehicle.log.parameter(name, result.value)
        vehicle.endpoint.echo_parameters(result.echoes)

    def _unknown(self, name: str) -> str:
        other = name_here(name, self._vehicle.params, ALL_RENAMES)
        return f"{name}: no such parameter" + ("" if other is None else f"; this firmware calls it {other}")

    def __iter__(self) -> Iterator[str]:
        """Go through the names in the order in which ground stations see them."""
        return (param.name for param in self._vehicle.params)

    def __len__(self) -> int:
        """Return how many parameters there are at the moment."""
        return self._vehicle.params.count
