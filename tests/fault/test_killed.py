# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Kill -9 at random moments: each log is readable to its last whole record, the parameters are old or new."""

import random
import select
import subprocess
import sys
from pathlib import Path

import pytest

from viso.logs.files import CHUNK_BYTES, LogStore
from viso.parameters.store import ParamStore

pytestmark = pytest.mark.slow

# A vehicle at full speed that takes samples, and every second of its time a new value for one of two parameters.
RUN_UNTIL_KILLED = """
import sys
from pathlib import Path
from viso.logs.files import LogStore
from viso.parameters.store import ParamStore
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import PARAM_SET, VISION_POSITION_ESTIMATE

folder = Path(sys.argv[1])
config = VehicleConfig(
    defaults={"VISO_TYPE": 1},
    log_store=LogStore(folder / "logs"),
    param_store=ParamStore(folder / "storage.parm"),
)
vehicle = Vehicle(config)
channel, time, codec = vehicle.endpoint.open_channel("x"), Scheduler(vehicle), Codec(255, 190)
time.run_until(5_000_000)
number = vehicle.params.get_int("VISO_QUAL_MIN")
print("running", flush=True)
while True:
    number = number % 100 + 1
    for name in ("VISO_DELAY_MS", "VISO_QUAL_MIN"):
        time.deliver(channel, codec.encode(PARAM_SET(1, 1, name, float(number), 9)))
        time.run_until(time.now_us + 1_000_000)
    for _ in range(50):
        time.deliver(channel, codec.encode(VISION_POSITION_ESTIMATE(time.now_us, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0)))
        time.run_until(time.now_us + 2500)
"""


def whole_records(data: bytes) -> int:
    """Return how many bytes of a log are whole records of described types, from the beginning."""
    lengths = {128: 89}
    at = 0
    while data[at : at + 2] == b"\xa3\x95" and len(data) > at + 2 and data[at + 2] in lengths:
        size = lengths[data[at + 2]]
        if at + size > len(data):
            break
        if data[at + 2] == 128:
            lengths[data[at + 3]] = data[at + 4]
        at += size
    return at


def run_and_kill(folder: Path, after_s: float) -> None:
    """Start a vehicle, and kill it a while after it has begun."""
    command = [sys.executable, "-c", RUN_UNTIL_KILLED, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "running\n"
        select.select([], [], [], after_s)
        child.kill()


def check_what_is_left(folder: Path, rounds: int) -> None:
    """Look at every file that the killed vehicles left."""
    store = LogStore(folder / "logs")
    assert store.log_numbers() == list(range(1, rounds + 1))
    for number in store.log_numbers():
        data = store.path_of(number).read_bytes()
        assert len(data) > CHUNK_BYTES
        assert len(data) - whole_records(data) < 256
        assert data[whole_records(data) :][:2] in (b"", b"\xa3", b"\xa3\x95")
    values = ParamStore(folder / "storage.parm").load()
    # Each was stored within a second of its time; the second of the pair may not have been.
    first, second = values.get("VISO_DELAY_MS", 0), values.get("VISO_QUAL_MIN", 0)
    assert (first - second) % 100 in (0, 1)
    assert values.get("STAT_BOOTCNT") == rounds


def kill_again_and_again(folder: Path, rounds: int, seed: int) -> None:
    """Kill one vehicle after the other in the same folder, each of which starts from what the last one left."""
    source = random.Random(seed)
    for number in range(1, rounds + 1):
        run_and_kill(folder, source.uniform(0.0, 0.3))
        check_what_is_left(folder, number)


def test_vehicle_killed_at_ten_moments_leaves_whole_files(tmp_path: Path) -> None:
    kill_again_and_again(tmp_path, rounds=10, seed=2)
