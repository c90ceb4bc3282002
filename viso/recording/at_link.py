# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A scenario recorded from whatever is at a link: an autopilot, or a vehicle of this program's own."""

from collections.abc import Callable
from contextlib import closing
from typing import Final

from mav_handlers.links import open_link
from viso.errors import InputError
from viso.firmware.releases import REFERENCE, Firmware
from viso.options.firmware import firmware_of
from viso.recording.driving import RealDriver, record_viso
from viso.recording.recorder import Recorder, Recording
from viso.recording.scenario import Scenario

VISO: Final = "viso"
MASTER_HELP: Final = (
    "Link to the autopilot, as of viso serve; viso or viso:FIRMWARE is a vehicle of this program's own in virtual time."
)


def record_at(
    master: str,
    scenario: Scenario,
    stops: Callable[[], int],
    *,
    on_progress: Callable[[str], None],
    allow_armed: bool = False,
    speedup: float | None = None,
) -> Recording:
    """Play a scenario to what is at a link and return what was recorded, complete or not.

    Args:
        master: as ``--master`` has it.
        scenario: what to play.
        stops: returns how often the user has asked to stop: once ends the steps, twice the download of the log.
        on_progress: told what is being done, a line at a time.
        allow_armed: record a vehicle that is armed.
        speedup: seconds of the autopilot in one second; None for what its clock tells.

    Raises:
        InputError: nothing was recorded, as nobody answers, or ``master`` names no release.
        LinkError: the link cannot be opened.
    """
    firmware = _viso_firmware(master)
    recorder = Recorder(scenario, allow_armed=allow_armed, on_progress=on_progress)
    if firmware is not None:
        record_viso(recorder, firmware, stops)
    else:
        with closing(open_link(master)) as link:
            RealDriver(recorder, link, stops, speedup=speedup).run()
            if (why := link.stats.unreached) and recorder.recording.problems:
                recorder.recording.problems[0] += f" ({why})"
    recording = recorder.recording
    if recording.version is None:
        raise InputError(f"--master {master}: {recording.problems[0]}")
    return recording


def _viso_firmware(master: str) -> Firmware | None:
    """Return the release that ``viso`` or ``viso:FIRMWARE`` names; None of any other link."""
    scheme, colon, name = master.partition(":")
    if scheme != VISO:
        return None
    return firmware_of(name, "--master viso:") if colon else REFERENCE
