# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a request for a sweep to its plan."""

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

import yaml

from mav_handlers.links.packed import name_unpacked
from viso.documents import parsed_yaml
from viso.errors import InputError, as_input_errors
from viso.extras import installed_version
from viso.faults import TimelineError, parse_timeline
from viso.faults.timeline import MAX_SEED
from viso.files.text_files import read_text
from viso.firmware.releases import DEFAULT, Firmware
from viso.streams.stream_kinds import DATAFLASH_LOG, STREAM_KINDS, TrajectoryOptions, kind_of
from viso.sweep.dimensions import Axis, fault_field, parse_axes, values_of
from viso.sweep.job import timeline_of
from viso.sweep.plan import FOLLOW, SAMPLINGS, Faults, Recorded, Sampling, SweepPlan, check_plan, input_file
from viso.sweep.request import NO_FAULTS, SweepRequest
from viso.terminal.ahrs import AhrsChoice, imu_options, of_stream
from viso.terminal.options import firmware_of
from viso.terminal.settings import known_parameters, load_settings, parse_assignments, preset_files
from viso.vehicle.sensors.flight import Basis
from viso.vehicle.sensors.flown.source import read_flight
from viso.vehicle.sensors.inertial_sources import FLOWN
from viso.vehicle.sensors.script.script_file import EXAMPLES

_NAME: Final = "{name}"
_CAPTURE: Final = "capture"
_LOG_ENDINGS: Final = (".BIN", ".BIN.xz", ".bin")
_MOST_SEEDS: Final = 1_000_000


def make_plan(request: SweepRequest) -> SweepPlan:
    """Return the plan of a requested sweep; all files are read. Raises InputError naming what cannot be used."""
    if not request.streams:
        raise InputError("no recorded stream is given")
    names = [name.strip() for text in request.firmware or () for name in text.split(",")]
    profiles = [firmware_of(name) for name in names or [DEFAULT.name]]
    axes = _axes(request, profiles)
    trajectory = _trajectory(request)
    imu_options(AhrsChoice(imu_errors=request.imu_error, heading_deg=request.heading or 0.0))
    plan = SweepPlan(
        recordings=_recordings(request, trajectory),
        axes=axes,
        settings={profile.name: _settings(request, profile) for profile in profiles},
        firmware=tuple(dict.fromkeys(profile.name for profile in profiles)),
        faults=_faults(request.faults, axes),
        seeds=_seeds(request.seeds),
        sampling=_sampling(request),
        baud=_at_least("--baud", request.baud, 0),
        imu_errors=tuple(request.imu_error or ()),
        heading_deg=request.heading or 0.0,
        lead_s=_lead(30.0 if request.lead is None else request.lead),
        until_s=_until(math.inf if request.until is None else request.until),
        trajectory=trajectory,
        code=installed_version(),
    )
    check_plan(plan)
    return plan


def _axes(request: SweepRequest, profiles: Sequence[Firmware]) -> tuple[Axis, ...]:
    found = [parse_axes(request.set, known_parameters(1, profile)) for profile in profiles]
    if any(axes != found[0] for axes in found):
        raise InputError("--set: the firmware profiles do not call these parameters the same")
    return found[0]


def _settings(request: SweepRequest, profile: Firmware) -> dict[str, float]:
    files = [*preset_files(request.preset), *(request.defaults or [])]
    loaded = load_settings(files, [], links=1, strict=bool(request.strict), firmware=profile)
    return {**loaded, **parse_assignments(request.param or [], "--param", links=1, firmware=profile)}


def _trajectory(request: SweepRequest) -> TrajectoryOptions:
    usual = TrajectoryOptions()
    form, axes = request.message or usual.form, request.axes or usual.axes
    return TrajectoryOptions(form, request.format, request.topic, request.times, axes, request.rate)


def _recordings(request: SweepRequest, options: TrajectoryOptions) -> tuple[Recorded, ...]:
    names = [_name_of(path) for path in request.streams]
    found: dict[str, Recorded] = {}
    for path, name in zip(request.streams, names, strict=True):
        shown = name if names.count(name) == 1 else str(path)
        if shown in found:
            raise InputError(f"{path}: given twice")
        found[shown] = _recorded(request, path, name, shown, options)
    return tuple(found.values())


def _recorded(request: SweepRequest, path: Path, name: str, shown: str, options: TrajectoryOptions) -> Recorded:
    kind = kind_of(path, options)
    file = input_file(path)
    ahrs, reference = (text and _absolute(text.replace(_NAME, name)) for text in (request.ahrs, request.reference))
    if ahrs is not None and (request.imu or request.imu_error):
        raise InputError("--ahrs and --imu: a vehicle that follows a log has no sensors")
    imu, basis = _imu(request.imu, path, name, kind)
    sensors = imu.partition(":")[2] if ahrs is None else ""
    used = [sensors if sensors not in ("", *EXAMPLES) else None, ahrs, reference]
    others = tuple(input_file(Path(path)) for path in dict.fromkeys(used) if path is not None)
    return Recorded(shown, file, imu, others, ahrs, reference, basis if ahrs is None else None)


def _imu(imu: str | None, path: Path, name: str, kind: str) -> tuple[str, Basis | None]:
    """Return the source of inertial data, and what its motion is made of if that is a log."""
    if imu is None:
        for log in (log for log in _logs_of(path, name, kind) if log.is_file()):
            with suppress(InputError):
                return f"{FLOWN}:{log.absolute()}", read_flight(log).basis
        return FOLLOW, None
    source, _, argument = (of_stream(imu, path) or "").replace(_NAME, name).partition(":")
    is_file = argument and argument not in EXAMPLES
    basis = read_flight(Path(argument)).basis if source == FLOWN and argument else None
    return f"{source}:{_absolute(argument)}" if is_file else imu, basis


def _logs_of(path: Path, name: str, kind: str) -> list[Path]:
    """Return where the sensors of a recording with times since boot may be: in itself, or in the log of its name."""
    if kind == DATAFLASH_LOG:
        return [path]
    folders = (path.absolute().parent, path.absolute().parent.parent / "logs") if kind == _CAPTURE else ()
    return [folder / f"{name}{ending}" for folder in folders for ending in _LOG_ENDINGS]


def _absolute(path: str) -> str:
    return str(Path(path).absolute())


def _name_of(path: Path) -> str:
    endings = sorted((ending for kind in STREAM_KINDS.values() for ending in kind.endings), key=len, reverse=True)
    name = name_unpacked(path)
    ending = next((ending for ending in endings if name.lower().endswith(ending)), "")
    return name[: len(name) - len(ending)]


def _faults(names: Sequence[str] | None, axes: Sequence[Axis]) -> tuple[Faults, ...]:
    found = tuple(_timeline(name) for name in dict.fromkeys(names or (NO_FAULTS,)))
    changed = [axis for axis in axes if fault_field(axis.name) is not None]
    if changed and not any(faults.text for faults in found):
        raise InputError(f"--set {changed[0].name}: there is no timeline; --faults FILE gives one")
    for faults in (timeline for timeline in found if timeline.text):
        for axis in changed:
            for value in axis.span or (axis.values[0], axis.values[-1]):
                timeline_of(faults, {axis.name: value})
    return found


def _timeline(name: str) -> Faults:
    if name == NO_FAULTS:
        return Faults()
    text = read_text(Path(name))
    with as_input_errors(TimelineError):
        parse_timeline(text, name)
    return Faults(name, yaml.safe_dump(parsed_yaml(text), sort_keys=False))


def _seeds(text: str | None) -> tuple[int | None, ...]:
    if text is None:
        return (None,)
    values, span = values_of(text, f"--seeds {text}")
    if span is not None:
        values = tuple(map(float, range(int(span[0]), min(int(span[1]), int(span[0]) + _MOST_SEEDS) + 1)))
    for value in values:
        if not (value.is_integer() and 0 <= value <= MAX_SEED):
            raise InputError(f"--seeds {text}: {value:g} is no whole number from 0 to {MAX_SEED}")
    return tuple(int(value) for value in values)


def _sampling(request: SweepRequest) -> Sampling | None:
    if request.sample is None:
        for option, value in (("--points", request.points), ("--sample-seed", request.sample_seed)):
            if value is not None:
                raise InputError(f"{option}: goes with --sample")
        return None
    if request.sample not in SAMPLINGS:
        raise InputError(f"--sample {request.sample}: there are {', '.join(SAMPLINGS)}")
    if request.points is None:
        raise InputError(f"--sample {request.sample}: --points sets how many")
    points, seed = _at_least("--points", request.points, 1), _at_least("--sample-seed", request.sample_seed, 0)
    return Sampling(request.sample, points or 1, seed or 0)


def _at_least(option: str, value: int | None, low: int) -> int | None:
    if value is not None and value < low:
        raise InputError(f"{option} {value}: not {low} or more")
    return value


def _lead(lead_s: float) -> float:
    if not 0 <= lead_s <= 4e9:
        raise InputError(f"--lead {lead_s}: not a time in seconds")
    return lead_s


def _until(until_s: float) -> float:
    if not until_s > 0:
        raise InputError(f"--until {until_s:g}: not a time since boot")
    return until_s
