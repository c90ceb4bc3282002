# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a filter tells the ground station, for each core that it stands for."""

from collections.abc import Sequence
from typing import Final

from ap_core.sinks import TextSink

MAV_SEVERITY_CRITICAL: Final = 2
MAV_SEVERITY_WARNING: Final = 4
MAV_SEVERITY_INFO: Final = 6
NUMBER_OF_IMUS: Final = 2


def cores_of_mask(imu_mask: int, imus: int = NUMBER_OF_IMUS) -> tuple[int, ...]:
    """Return the IMU of each core by EK3_IMU_MASK, of as many as there are."""
    return tuple(imu for imu in range(imus) if imu_mask >> imu & 1)


class CoreTexts:
    """Collects the lines of one frame and sends them, all of one core and then all of the next.

    ``cores`` has the IMU of each core that the filter stands for; ``waiting`` are the lines, each with its severity.
    """

    def __init__(self, texts: TextSink, cores: Sequence[int]) -> None:
        self._texts = texts
        self._cores = tuple(cores)
        self.waiting: list[tuple[int, str]] = []

    def add(self, text: str, severity: int = MAV_SEVERITY_INFO) -> None:
        """Add a line of this frame: what follows ``EKF3 IMU0 ``."""
        self.waiting.append((severity, text))

    def flush(self) -> None:
        """Send the lines."""
        for core in self._cores:
            for severity, text in self.waiting:
                self._texts.send_text(severity, f"EKF3 IMU{core} {text}")
        self.waiting.clear()
