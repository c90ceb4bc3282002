# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The reports of a vehicle's own filter in a log: XKF or NKF records, texts, events and errors."""

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ekf_stub.ahrs.sources import EXTNAV, ROWS, SETS, SourceXY, SourceYaw, SourceZ
from viso.doctor.evidence.own_filter import (
    OtherCore,
    OwnFilter,
    Witness,
    aiding_texts,
    innovation_sizes,
    says_origin,
    sources_over,
    spans_between,
)
from viso.doctor.evidence.tracks import Floats, Ints
from viso.estimators.series import Series, rows_in_time
from viso.logs.event_names import (
    ERR_EKF_FAILSAFE,
    ERR_EKFCHECK,
    EV_ARMED,
    EV_DISARMED,
    EV_SOURCE_SET_1,
    error_text,
)
from viso.logs.filter_records import (
    EKF2,
    FilterRecords,
    filter_records_in,
    logs_while_armed_alone,
    parameters_in,
    rows_of,
)

_FAILSAFES: Final = (ERR_EKFCHECK, ERR_EKF_FAILSAFE)
_RATIOS: Final = ("SV", "SP", "SH", "SM")
_INNOVATIONS: Final = ("IVN", "IVE", "IVD", "IPN", "IPE", "IPD", "IYAW")
# EK2_ALT_SOURCE, as EK3_SRCn_POSZ has them.
_EKF2_HEIGHT: Final[Mapping[int, int]] = {
    0: SourceZ.BARO,
    1: SourceZ.RANGEFINDER,
    2: SourceZ.GPS,
    3: SourceZ.BEACON,
    4: EXTNAV,
}


def own_filter_in(log: LogColumns, records: FilterRecords | None = None) -> OwnFilter:
    """Return what the vehicle's own filter reported in a log, whose records may have been read already."""
    records = filter_records_in(log) if records is None else records
    status = records.status
    time_us = _us(status.time_s)
    texts = tuple((time, str(text)) for time, text in rows_of(log, "MSG", "Message"))
    innovations = records.innovations
    return OwnFilter(
        witness=Witness.LOG,
        record=f"{records.prefix}4" if len(status) else "",
        time_us=time_us,
        ratios=status.matrix(*_RATIOS),
        flags=_bits(status, "SS"),
        timeouts=_bits(status, "TS"),
        sources=_sources(log, time_us, texts, records.prefix),
        innovation_us=_us(innovations.time_s),
        innovations=innovation_sizes(innovations.matrix(*_INNOVATIONS)),
        armed=_armed(log, time_us),
        texts=texts,
        failsafes=tuple(
            (time, error_text(int(subsystem), int(code)))
            for time, subsystem, code in rows_of(log, "ERR", "Subsys", "ECode")
            if subsystem in _FAILSAFES and code
        ),
        lanes=tuple(_lanes(records.every_status)),
        others=tuple(_others(records)),
        has_origin=_has_origin(log, texts),
    )


def _has_origin(log: LogColumns, texts: tuple[tuple[int, str], ...]) -> bool | None:
    """Return whether the EKF got an origin: ORGN is written when it is set, and at the begin of a log that has one."""
    if log.counts.get("ORGN") or says_origin(texts):
        return True
    return False if "ORGN" in log.types and texts else None


def _us(time_s: Floats) -> Ints:
    return np.asarray(np.rint(time_s * 1e6), dtype=np.int64)


def _bits(series: Series, label: str) -> Ints:
    return np.asarray(np.nan_to_num(series[label]), dtype=np.int64)


def _armed(log: LogColumns, time_us: Ints) -> tuple[tuple[float, float], ...] | None:
    states = [(time, bool(state)) for time, state in rows_of(log, "ARM", "ArmState")]
    if not states:
        known = {EV_ARMED: True, EV_DISARMED: False}
        states = [(time, known[event]) for time, event in rows_of(log, "EV", "Id") if event in known]
    spoken = [time for kind in ("PARM", "MSG", "EV", "ARM") for (time,) in rows_of(log, kind)]
    every_us = rows_in_time(np.array([*spoken, *time_us.tolist()], dtype=np.float64)[:, None]).ravel()
    start_us, end_us = (int(every_us[0]), int(every_us[-1])) if len(every_us) else (0, 0)
    if states:
        return spans_between(states, start_us, max(end_us, states[-1][0]))
    if logs_while_armed_alone(log):
        return ((start_us * 1e-6, end_us * 1e-6),)
    logs_disarmed = any(name == "LOG_DISARMED" and value != 0 for _, name, value in parameters_in(log))
    # From the boot on, arming would be there.
    return () if log.counts.get("EV") or (logs_disarmed and "ARM" in log.types) else None


def _sources(log: LogColumns, time_us: Ints, texts: tuple[tuple[int, str], ...], prefix: str) -> Ints:
    params: dict[str, float] = {}
    changes = []
    for time, name, value in parameters_in(log):
        if name in params:
            changes.append((int(time), name, value))
        params.setdefault(name, value)
    reported = [(time, by_extnav) for time, by_extnav, _ in aiding_texts(texts)]
    if prefix == EKF2:
        return _ekf2_sources(time_us, params, reported)
    switches = [(time, int(number)) for time, number in rows_of(log, "XKFS", "SS")]
    if not switches:
        sets = range(EV_SOURCE_SET_1, EV_SOURCE_SET_1 + SETS)
        switches = [(time, event - EV_SOURCE_SET_1) for time, event in rows_of(log, "EV", "Id") if event in sets]
    return sources_over(time_us, params, changes, _changes(switches), reported)


def _changes(states: list[tuple[int, int]]) -> list[tuple[int, int]]:
    return [state for number, state in enumerate(states) if number == 0 or state[1] != states[number - 1][1]]


def _ekf2_sources(time_us: Ints, params: Mapping[str, float], reported: list[tuple[int, bool]]) -> Ints:
    """Return the sources of EKF2, which takes positions and yaw from external navigation in place of a GPS."""
    found = sources_over(time_us, {}, (), (), reported)
    by_extnav = found[:, ROWS.index("POSXY")] == EXTNAV
    compass = params.get("COMPASS_ENABLE", 1) != 0 and params.get("COMPASS_USE", 1) != 0
    horizontal = np.where(by_extnav, EXTNAV, int(SourceXY.GPS))
    for row in ("POSXY", "VELXY", "VELZ"):
        found[:, ROWS.index(row)] = horizontal
    found[:, ROWS.index("POSZ")] = _EKF2_HEIGHT.get(int(params.get("EK2_ALT_SOURCE", 0)), SourceZ.BARO)
    found[:, ROWS.index("YAW")] = SourceYaw.COMPASS if compass else np.where(by_extnav, EXTNAV, int(SourceYaw.NONE))
    return found


def _lanes(every: Series) -> Iterator[tuple[int, int]]:
    """Yield when another core became the primary one, and which."""
    primary = every["PI"][np.isfinite(every["PI"])]
    time_us = _us(every.time_s[np.isfinite(every["PI"])])
    for index in np.flatnonzero(np.diff(primary)) + 1:
        yield int(time_us[index]), int(primary[index])


def _others(records: FilterRecords) -> Iterator[OtherCore]:
    every = records.every_status
    cores = np.nan_to_num(every["C"])
    over = np.nan_to_num(every.matrix(*_RATIOS)).max(axis=1, initial=0.0)
    is_primary = cores == every["PI"]
    latest = np.searchsorted(every.time_s[is_primary], every.time_s, side="right")
    of_primary = np.concatenate([[0.0], over[is_primary]])[latest]
    unused = (over > 1.0) & (of_primary <= 1.0) & np.isfinite(every["PI"]) & ~is_primary
    for core in np.unique(cores[unused]).tolist():
        of_core = cores == core
        steps_s = np.append(np.diff(every.time_s[of_core]), 0.0)
        mine = unused[of_core]
        first_us = int(_us(every.time_s[of_core][mine])[0])
        yield OtherCore(int(core), float(steps_s[mine].sum()), float(over[of_core][mine].max()), first_us)
