# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how fast the project runs on this machine: all benches or those that are named, by pyperf.

pyperf's options say how long to measure and where to write the figures. A table of the figures, in Markdown, ends the
run. Example: python -m tools.bench message parse -o speed.json
"""

from __future__ import annotations

import json
import math
import os
import socket
import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import pyperf
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as dialect

from tools.measured import commit, render
from tools.project_files import ROOT

if TYPE_CHECKING:
    from mav_handlers.wire.codec import Codec
    from mav_handlers.wire.messages import ODOMETRY

VISO: Final = (sys.executable, "-c", "from viso.cli import main; main()")
CAPTURE: Final = ROOT / "tests/data/parity/2025-07/captures/flight_t265.jsonl.gz"
PERIOD_US: Final = 33_333
MESSAGES_A_SECOND: Final = 30
WARM_UP_MESSAGES: Final = 400
"""Until the vehicle fuses what it is sent, and for longer."""
LOG_S: Final = 100
IDLE_S: Final = 5
FRAMES: Final = 4000
"""Of a round of the filter: ten seconds."""

_LOOP_US: Final = 2500
_WARM_UP_FRAMES: Final = 12_000
_POSE_FRAMES: Final = 13
_COVARIANCE: Final = (1e-3, *[0.0] * 5, 1e-3, *[0.0] * 4, 1e-3, *[0.0] * 3, 1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)
_PARAMS: Final = {
    "VISO_TYPE": 1,
    "GPS1_TYPE": 0,
    "LOG_DISARMED": 1,
    **{f"EK3_SRC1_{what}": 6 for what in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")},
}

Round = Callable[[], float]
"""Does a round, and returns the seconds that it took."""


class Bench(NamedTuple):
    """A bench.

    Attributes:
        unit: what the work is counted in.
        amount: units in a round.
        prepare: gets everything ready, and returns what does a round. It imports the filter itself, so that the filter
            can be interpreted in its process.
        beside: the bench to compare with, if any.
        most_us: the target, for a unit; None if there is none.
        most_ratio: the target for the ratio to ``beside``.
    """

    unit: str
    amount: int
    prepare: Callable[[ExitStack], Round]
    beside: str = ""
    most_us: float = math.inf
    most_ratio: float = math.inf


def odometry_at(time_us: int) -> ODOMETRY:
    """Return what a camera sends that sways near the origin, level, heading north."""
    from mav_handlers.wire.messages import ODOMETRY

    sway_m, phase = 0.02, time_us * 1e-6
    pose = (sway_m * math.sin(phase), 0.0, 0.0, (1.0, 0.0, 0.0, 0.0))
    motion = (sway_m * math.cos(phase), 0.0, 0.0, 0.0, 0.0, 0.0)
    return ODOMETRY(time_us, 20, 12, *pose, *motion, _COVARIANCE, _COVARIANCE, 0, 0, 90)


def frames_of(codec: Codec, first_us: int, count: int) -> list[tuple[int, bytes]]:
    """Return ODOMETRY as bytes, with the times at which the messages arrive."""
    times_us = [first_us + number * PERIOD_US for number in range(count)]
    return [(time_us, codec.encode(odometry_at(time_us))) for time_us in times_us]


class FullVehicle:
    """A vehicle at rest with its filter and its log, and the camera that it navigates by.

    Args:
        log_dir: where its log goes.
        imus: how many IMUs it has that differ, each with a core.
        params: further parameters.

    Attributes:
        vehicle: it.
    """

    def __init__(self, log_dir: Path, *, imus: int = 1, **params: float) -> None:
        from mav_handlers.wire.codec import Codec
        from viso.logs.files import LogStore
        from viso.running.virtual_time import Scheduler
        from viso.vehicle.config import by_ekf3
        from viso.vehicle.sensors.errors import SensorErrors
        from viso.vehicle.sensors.source import ImuOptions
        from viso.vehicle.sensors.standing import BenchSource
        from viso.vehicle.vehicle import Vehicle, VehicleConfig

        mask = {"EK3_IMU_MASK": (1 << imus) - 1} if imus > 1 else {}
        config = VehicleConfig(defaults={**_PARAMS, **mask, **params}, log_store=LogStore(log_dir))
        if imus > 1:
            errors = SensorErrors(gyro_noise_deg_s_rthz=0.01, accel_noise_m_s2_rthz=0.001, imus=imus)
            config = replace(config, make_ahrs=by_ekf3(BenchSource, ImuOptions(errors=errors)))
        self.vehicle = Vehicle(config)
        self._scheduler = Scheduler(self.vehicle)
        self._channel = self.vehicle.endpoint.open_channel("companion")
        self._codec = Codec(1, 197)
        self._next_us = PERIOD_US

    def run(self, messages: int, *, main_loop: bool = True) -> float:
        """Run for some messages, if ``main_loop`` with all passes between them; return the seconds that this took."""
        frames = frames_of(self._codec, self._next_us, messages)
        self._next_us += messages * PERIOD_US
        begin_s = time.process_time()
        for time_us, frame in frames:
            if main_loop:
                self._scheduler.run_until(time_us)
                self._scheduler.deliver(self._channel, frame)
            else:
                self.vehicle.clock.set_us(time_us)
                self.vehicle.receive_bytes(self._channel, frame)
            self.vehicle.endpoint.bytes_to_send(self._channel)
        return time.process_time() - begin_s


def _vehicle(stack: ExitStack) -> FullVehicle:
    flown = FullVehicle(Path(stack.enter_context(TemporaryDirectory())))
    stack.callback(flown.vehicle.close)
    flown.run(WARM_UP_MESSAGES)
    return flown


def prepare_vehicle(stack: ExitStack) -> Round:
    """A round is a second of a vehicle, which gets 30 messages."""
    return partial(_vehicle(stack).run, MESSAGES_A_SECOND)


def prepare_message(stack: ExitStack) -> Round:
    """A round is 100 messages for a vehicle whose main loop stands still."""
    return partial(_vehicle(stack).run, 100, main_loop=False)


def prepare_parse(_stack: ExitStack) -> Round:
    """A round is the parsing of 100 messages by pymavlink."""
    from mav_handlers.wire.codec import Codec

    frames = frames_of(Codec(1, 197), PERIOD_US, 100)

    def parse() -> float:
        parser = dialect.MAVLink(None)
        begin_s = time.process_time()
        for _, frame in frames:
            parser.parse_char(frame)
        return time.process_time() - begin_s

    return parse


def prepare_filter(_stack: ExitStack) -> Round:
    """A round is ten seconds of one core at rest that gets a pose and a velocity 30 times per second."""
    from ap_core.param import ParamTable
    from ap_visualodom.ap_visualodom import make_params
    from ekf_stub.core.buffers import buffer_sizes
    from ekf_stub.core.imus import Imus
    from ekf_stub.core.inertial import GRAVITY_MSS
    from ekf_stub.core.lanes import Lanes
    from ekf_stub.core.params import EkfSources, Params
    from ekf_stub.release import STABLE_4_7
    from viso.parameters.table import make_groups

    table = ParamTable(make_groups(0, make_params()))
    for name, value in _PARAMS.items():
        if name.startswith("EK3_"):
            table.set(name, value)
    sources = EkfSources(lambda name: table.get_int(f"EK3_{name}"))
    params = Params()
    params.read(lambda name: table.get_number(f"EK3_{name}"))
    sizes = buffer_sizes(table.get_int, sources, has_camera=True, has_flow=False)
    imus = Imus(1)
    imus.imus[0].has_data = True
    lanes = Lanes(params, sources, [sizes], STABLE_4_7, imus, [0], [0], 1)
    at_rest = [0.0, 0.0, 0.0, 0.0, -GRAVITY_MSS * _LOOP_US / 1e6, 0.0, 0.0, 0.0, _LOOP_US / 1e6, _LOOP_US / 1e6]
    frame = 0

    def run(frames: int) -> float:
        nonlocal frame
        elapsed_s, end = 0.0, frame + frames
        while frame < end:
            count = min(_POSE_FRAMES, end - frame)
            stamps_us = [5e6 + number * _LOOP_US for number in range(frame + 1, frame + count + 1)]
            rows = [value for stamp_us in stamps_us for value in (stamp_us, *at_rest)]
            begin_s, done = time.process_time(), 0
            while done < count:
                done = lanes.advance(rows, done, count)
            (core,) = lanes.cores
            stamp_ms = lanes.now_us // 1000
            core.ext_nav.write_pose((0.0, 0.0, 0.0), 0.1, 0.0, 0.1, stamp_ms, 10, 0)
            core.ext_nav.write_velocity((0.0, 0.0, 0.0), 0.1, stamp_ms, 10)
            core.events.outcomes.clear()
            elapsed_s += time.process_time() - begin_s
            lanes.texts.clear()
            frame += count
        return elapsed_s

    run(_WARM_UP_FRAMES)
    return partial(run, FRAMES)


def interpreted(prepare: Callable[[ExitStack], Round], stack: ExitStack) -> Round:
    """Prepare a bench in a process that has not imported the filter yet, and imports its sources."""
    os.environ["VISO_PURE"] = "1"
    prepared = prepare(stack)
    from ekf_stub.core import IS_COMPILED

    if IS_COMPILED:
        raise RuntimeError("something has imported the compiled filter before")
    return prepared


def cost_of(*arguments: str) -> float:
    """Run a command of viso to its end; return the seconds of the processor that it took."""
    before = os.times()
    subprocess.run([*VISO, *arguments], check=False, capture_output=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def _log(stack: ExitStack) -> str:
    folder = Path(stack.enter_context(TemporaryDirectory()))
    flown = FullVehicle(folder, imus=2, LOG_REPLAY=1)
    flown.run(LOG_S * MESSAGES_A_SECOND)
    flown.vehicle.close()
    return str(folder / "00000001.BIN")


def prepare_ekf(stack: ExitStack) -> Round:
    """A round is ``viso ekf`` over a log of 100 s with two IMUs that differ."""
    return partial(cost_of, "ekf", _log(stack))


def prepare_dfreader(stack: ExitStack) -> Round:
    """A round is DFReader over the same log, which it opens, indexes and reads record by record."""
    path = _log(stack)

    def read() -> float:
        begin_s = time.process_time()
        with DFReader_binary(path) as log:
            while log.recv_msg() is not None:
                pass
        return time.process_time() - begin_s

    return read


def prepare_doctor(_stack: ExitStack) -> Round:
    """A round is ``viso doctor`` over a recorded flight of 77 s."""
    return partial(cost_of, "doctor", str(CAPTURE))


def idle_cost(folder: str) -> float:
    """Return the seconds of the processor that a started vehicle takes that nobody sends anything, for some seconds."""
    command = [*VISO, "serve", "--master", "udpout:127.0.0.1:9", "--param", "VISO_TYPE=1", "--log-dir", folder]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            time.sleep(3.0)  # until its filter has started
            before_s = _processor_s(process.pid)
            time.sleep(IDLE_S)
            return _processor_s(process.pid) - before_s
        finally:
            process.terminate()


def _processor_s(process_id: int) -> float:
    """Return the seconds of the processor that a running process has taken (proc_pid_stat(5))."""
    fields = Path(f"/proc/{process_id}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def start_s(folder: str) -> float:
    """Return the seconds by the clock from the start of ``viso serve`` until it accepts the first ODOMETRY."""
    from mav_handlers.wire.codec import Codec

    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(20.0)
        link = f"tcp:127.0.0.1:{listening.getsockname()[1]}"
        command = [
            *VISO,
            "serve",
            "--master",
            link,
            "--param",
            "VISO_TYPE=1",
            "--verdicts",
            "json",
            "--log-dir",
            folder,
        ]
        begin_s = time.perf_counter()
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            assert process.stdout is not None
            try:
                with listening.accept()[0] as connection:
                    connection.sendall(Codec(1, 197).encode(odometry_at(1_000_000)))
                    verdicts = map(json.loads, process.stdout)
                    assert any((one["type"], one["outcome"]) == ("ODOMETRY", "accepted") for one in verdicts)
                    return time.perf_counter() - begin_s
            finally:
                process.terminate()


def _in_folder(measure: Callable[[str], float], stack: ExitStack) -> Round:
    return partial(measure, stack.enter_context(TemporaryDirectory()))


BENCHES: Final[Mapping[str, Bench]] = {
    "filter": Bench("frames", FRAMES, prepare_filter, most_us=5.0),
    "filter-interpreted": Bench("frames", FRAMES, partial(interpreted, prepare_filter), "filter", most_us=90.0),
    "vehicle": Bench("s simulated", 1, prepare_vehicle, most_us=5_000.0),
    "vehicle-interpreted": Bench("s simulated", 1, partial(interpreted, prepare_vehicle), "vehicle", most_us=22_000.0),
    "parse": Bench("messages", 100, prepare_parse),
    "message": Bench("messages", 100, prepare_message, "parse", most_ratio=2.4),
    "dfreader": Bench("logs", 1, prepare_dfreader),
    "ekf": Bench("logs", 1, prepare_ekf, "dfreader", most_us=1.5e6, most_ratio=0.35),
    "doctor": Bench("flights", 1, prepare_doctor, most_us=1.8e6),
    "start": Bench("starts", 1, partial(_in_folder, start_s), most_us=0.5e6),
    "idle": Bench("s", IDLE_S, partial(_in_folder, idle_cost), most_us=30_000.0),
}
HEAD: Final = ("bench", "in a second", "us each", "95 %", "ratio", "target", "")


def rows(measured: Mapping[str, pyperf.Benchmark]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each bench: its best round, and whether its target is met."""
    best_s = {name: min(bench.get_values()) for name, bench in measured.items()}
    for name, each_s in best_s.items():
        bench = BENCHES[name]
        ratio = each_s / best_s[bench.beside] if bench.beside in best_s else None
        limits = [(each_s * 1e6, bench.most_us, " us"), (ratio, bench.most_ratio, f" x {bench.beside}")]
        targets = [(value, most, unit) for value, most, unit in limits if value is not None and most < math.inf]
        yield (
            name,
            f"{_number(1 / each_s)} {bench.unit}",
            _number(each_s * 1e6),
            _number(measured[name].percentile(95) * 1e6),
            "" if ratio is None else f"{ratio:.3g} x {bench.beside}",
            ", ".join(f"{_number(most)}{unit}" for _, most, unit in targets),
            ("met" if all(value <= most for value, most, _ in targets) else "missed") if targets else "",
        )


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def _rounds(bench: Bench, stack: ExitStack) -> Callable[[int], float]:
    prepared = cache(lambda: bench.prepare(stack))  # by the worker, when pyperf asks for the first value
    return lambda loops: sum(prepared()() for _ in range(loops))


def _pass_names_on(command: list[str], options: Namespace) -> None:
    command.extend(options.names)


def main() -> None:
    """Run the benches that the command line names, each in processes of its own, and print the table."""
    metadata: dict[str, Any] = {"commit": commit()}
    program = ("-m", "tools.bench")
    runner = pyperf.Runner(
        values=5, processes=4, metadata=metadata, program_args=program, add_cmdline_args=_pass_names_on
    )
    runner.argparser.add_argument("names", nargs="*", metavar="BENCH", help=f"any of {', '.join(BENCHES)}")
    options = runner.parse_args()
    if unknown := set(options.names) - BENCHES.keys():
        runner.argparser.error(f"no such bench: {', '.join(sorted(unknown))}")
    measured = {}
    for name, bench in BENCHES.items():
        if not options.names or name in options.names:
            with ExitStack() as stack:
                measured[name] = runner.bench_time_func(name, _rounds(bench, stack), inner_loops=bench.amount)
    if not options.worker:
        print(f"\n{render(HEAD, rows(measured))}")


if __name__ == "__main__":
    main()
