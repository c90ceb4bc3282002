# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What whole commands cost, in seconds of the processor, and DFReader over the same log."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from pymavlink.DFReader import DFReader_binary

from tools.bench.logs import receive_all
from tools.bench.vehicles import MESSAGES_A_SECOND, FullVehicle
from tools.project_files import ROOT

VISO: Final = (sys.executable, "-c", "from viso.cli import main; main()")
LOG_S: Final = 100
"""Length of the log that the filter is run over: of a vehicle at rest, two IMUs that differ, a core for each."""

CAPTURE: Final = ROOT / "tests/data/captures/flight_t265.jsonl.gz"
IDLE_S: Final = 5
"""For how long a serving vehicle is watched."""

_STARTED_S: Final = 3.0  # after which its filter has started


def cost_of(*arguments: str) -> float:
    """Run a command of viso to its end; return the seconds of the processor that it took."""
    before = os.times()
    subprocess.run([*VISO, *arguments], check=False, capture_output=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def _log(stack: ExitStack) -> Path:
    folder = Path(stack.enter_context(TemporaryDirectory()))
    flown = FullVehicle(folder, imus=2, LOG_REPLAY=1)
    flown.run(LOG_S * MESSAGES_A_SECOND)
    flown.vehicle.close()
    return folder / "00000001.BIN"


def prepare_ekf(stack: ExitStack) -> Callable[[], float]:
    """A round is ``viso ekf`` over a log."""
    return partial(cost_of, "ekf", str(_log(stack)))


def prepare_dfreader(stack: ExitStack) -> Callable[[], float]:
    """A round is DFReader over the same log, which it opens, indexes and reads record by record."""
    path = _log(stack)

    def read() -> float:
        begin_s = time.process_time()
        with DFReader_binary(str(path)) as log:
            receive_all(log)
        return time.process_time() - begin_s

    return read


def prepare_doctor(_stack: ExitStack) -> Callable[[], float]:
    """A round is ``viso doctor`` over a recorded flight of 77 s."""
    return partial(cost_of, "doctor", str(CAPTURE))


def _processor_s(process: subprocess.Popen[bytes]) -> float:
    """Return the seconds of the processor that a running process has taken (proc_pid_stat(5))."""
    fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def idle_cost(folder: Path) -> float:
    """Return the seconds of the processor that a vehicle takes that nobody sends anything."""
    command = [*VISO, "serve", "--master", "udpout:127.0.0.1:9", "--param", "VISO_TYPE=1", "--log-dir", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            time.sleep(_STARTED_S)
            before_s = _processor_s(process)
            time.sleep(IDLE_S)
            return _processor_s(process) - before_s
        finally:
            process.terminate()


def prepare_idle(stack: ExitStack) -> Callable[[], float]:
    """A round is ``viso serve`` for some seconds, once it has started."""
    return partial(idle_cost, Path(stack.enter_context(TemporaryDirectory())))
