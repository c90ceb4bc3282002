# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight's log in the page of the live view: what the log does not have is null, or left out, and is never 0."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from ap_core.param_group import ParamSlot
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.reports import FilterFlag
from viso.doctor.evidence.own_filter import CHANNELS, NOT_KNOWN, OwnFilter, source_name
from viso.estimators.series import Array, Mask, Series, wrapped_deg
from viso.firmware.releases import Firmware
from viso.logs.event_names import EV_SOURCE_SET_1
from viso.parameters.releases import MAX_LINKS
from viso.parameters.table import make_groups
from viso.report.agreement import BRIDGED_S, lag_ms
from viso.report.facts import UNHEALTHY_S, Facts, positioned_at, withheld_why
from viso.report.flight_data import Material
from viso.report.summary import Level, Summary
from viso.vehicle.outcomes import UNITS
from viso.web.feed import LOOK_PERIOD_S
from viso.web.live_state import finite, row_of, shown
from viso.web.rates import WINDOW_US
from viso.web.recording import MOMENT_S, MOST_POINTS, recording
from viso.web.runs import RunKey, Runs

_RECORDS: Final = ("VISP", "VISV", "VISO")
_KINDS: Final[Mapping[str, str]] = {"position": "pose"}
"""What the page calls a channel of the filter, where it has another name."""
_UNKNOWN: Final = {"unit": "", "about": "", "range": None, "values": (), "reboot": False, "read_only": False}
"""What is known about a parameter that the release has not."""
_WINDOW_S: Final = WINDOW_US / 1e6
_ERROR: Final = 3
_TONES: Final = {Level.GOOD: "good", Level.WARNING: "warn", Level.BAD: "bad"}


def log_recording(material: Material, facts: Facts, summary: Summary) -> dict[str, Any]:
    """Return the message that shows a log."""
    length_s = max(facts.end_s - facts.start_s, LOOK_PERIOD_S)
    points = _points(material, facts, _ends(facts, max(LOOK_PERIOD_S, length_s / MOST_POINTS)))
    moments = _moments(material, facts, _ends(facts, max(MOMENT_S, length_s / MOST_POINTS)))
    flown = material.flown
    everything = {
        "banner": material.name if flown is None else f"{material.name}: {flown.text}",
        "boots": 1,
        "lost": 0,
        "state": moments[-1]["state"],
        "runs": _runs(material),
        "rates": moments[-1]["rates"],
        "points": points,
        "texts": [
            [happening.time_s, _ERROR if happening.is_trouble else happening.kind, happening.text]
            for happening in material.happenings
        ],
        "table": list(_table(material, facts.judged_by.firmware)),
        "units": UNITS,
        "sources": _sources(facts.own),
        "summary": {
            "badge": summary.level.badge,
            "tone": _TONES.get(summary.level, ""),
            "sentence": summary.sentence,
            "remarks": [[_TONES.get(remark.level, ""), remark.text] for remark in summary.remarks],
            "absent": list(summary.absent),
        },
    }
    return recording(everything, moments)


def _ends(facts: Facts, period_s: float) -> Array:
    """Return the ends of periods, no longer than asked for, of which the last one is the end of the log."""
    count = max(1, math.ceil((facts.end_s - facts.start_s) / period_s))
    ends_s = facts.start_s + period_s * np.arange(1, count + 1, dtype=np.float64)
    ends_s[-1] = facts.end_s
    return ends_s


def _between(time_s: Array, ends_s: Array) -> Iterator[slice]:
    """Yield the records of each period."""
    edges = np.searchsorted(time_s, ends_s, side="right").tolist()
    return (slice(first, last) for first, last in zip([0, *edges[:-1]], edges, strict=True))


def _latest(time_s: Array, ends_s: Array) -> list[int]:
    """Return which record is the last one up to each time; -1 before the first."""
    return [int(number) for number in np.searchsorted(time_s, ends_s, side="right") - 1]


def _points(material: Material, facts: Facts, ends_s: Array) -> list[dict[str, Any]]:
    xkf1, visp, timed, own = material.xkf1, material.visp, material.stamped, facts.own
    lags_ms = lag_ms(timed)
    yaw_deg = wrapped_deg(xkf1["Yaw"])
    pos_ned = np.where(positioned_at(own, xkf1.time_s)[:, np.newaxis], xkf1.matrix("PN", "PE", "PD"), np.nan)
    observed_ned, withheld = visp.matrix("PX", "PY", "PZ"), visp["Ign"] > 0
    quality = timed["Q"]
    ratios = np.where(_tested(facts), own.ratios, np.nan)
    fresh_s = max(BRIDGED_S, float(ends_s[0] - facts.start_s))
    points = []
    spans = (_between(times, ends_s) for times in (visp.time_s, timed.time_s, np.asarray(own.time_us / 1e6)))
    for end_s, state, *parts in zip(ends_s.tolist(), _latest(xkf1.time_s, ends_s), *spans, strict=True):
        observed, measured, tested = parts
        is_known = state >= 0 and end_s - xkf1.time_s[state] <= fresh_s
        points.append(
            {
                "t": round(end_s, 3),
                "ekf": _place(pos_ned[state]) if is_known else None,
                "yaw_deg": finite(yaw_deg[state], 1) if is_known else None,
                "vision": _vision(observed_ned[observed], withheld[observed]),
                "lag": _spread(lags_ms[measured], worst=max),
                "quality": _spread(quality[measured], worst=min),
                "innovations": _innovations(own, ratios, tested),
            }
        )
    return points


def _place(pos_ned: Array) -> list[float] | None:
    return pos_ned.round(3).tolist() if np.isfinite(pos_ned).all() else None


def _vision(pos_ned: Array, withheld: Mask) -> dict[str, Any] | None:
    """Return the last pose of some, if there is one."""
    return {"pos": _place(pos_ned[-1]), "ignored": bool(withheld[-1])} if len(pos_ned) else None


def _spread(values: Array, worst: Any) -> list[float] | None:
    """Return the median and the worst, if any is known."""
    known = values[np.isfinite(values)]
    return [round(float(np.median(known)), 1), round(float(worst(known)), 1)] if len(known) else None


def _tested(facts: Facts) -> Mask:
    """Return N x 4, whether the filter's test ratios are of samples: 0 is logged where there was none."""
    own = facts.own
    never = [own.fed_by_extnav(channel) & (not facts.measurements) for channel in range(len(CHANNELS))]
    return own.usable & ~np.column_stack(never)


def _innovations(own: OwnFilter, every_ratio: Array, tested: slice) -> dict[str, dict[str, Any]]:
    """Return the worst test ratio of each channel, with the innovation that was logged last by then."""
    found = {}
    for channel, name in enumerate(CHANNELS):
        ratios = every_ratio[tested, channel]
        if np.isfinite(ratios).any():
            worst = int(np.nanargmax(ratios))
            latest = int(np.searchsorted(own.innovation_us, own.time_us[tested][worst], side="right")) - 1
            found[_KINDS.get(name, name)] = {
                "ratio": finite(ratios[worst]),
                "value": finite(own.innovations[latest, channel]) if latest >= 0 else None,
                "gate": None,
                "tested": len(ratios),
                "rejected": int((ratios > 1).sum()),
            }
    return found


def _sources(own: OwnFilter) -> dict[str, str]:
    named = ((name, channel, own.source(channel)) for channel, name in enumerate(CHANNELS))
    return {
        _KINDS.get(name, name): source_name(channel, source) for name, channel, source in named if source != NOT_KNOWN
    }


def _moments(material: Material, facts: Facts, ends_s: Array) -> list[dict[str, Any]]:
    own, xkf1 = facts.own, material.xkf1
    oldest_s = ends_s - max(MOMENT_S, float(ends_s[0] - facts.start_s))  # of what is of that moment
    modes = [happening for happening in material.happenings if happening.kind == "mode"]
    sets = [
        happening
        for happening in material.happenings
        if happening.kind == "event" and 0 <= happening.number - EV_SOURCE_SET_1 <= 2
    ]
    latest = [
        _latest(np.asarray(times, np.float64), ends_s)
        for times in (
            [mode.time_s for mode in modes],
            [event.time_s for event in sets],
            own.time_us * 1e-6,
            xkf1.time_s,
            facts.arrivals_s,
        )
    ]
    yaw_deg, has_flags = wrapped_deg(xkf1["Yaw"]), bool(own.flags.any())
    counted = [_Counted(name, series) for name, series in zip(_RECORDS, material.vision, strict=True) if len(series)]
    is_off = not facts.measurements and material.parameter("VISO_TYPE") == 0
    moments = []
    columns = zip(ends_s.tolist(), oldest_s.tolist(), *latest, strict=True)
    for end_s, since_s, mode, source_set, status, attitude, arrival in columns:
        state: dict[str, Any] = {"time_s": round(end_s, 3), "faults": [], "clients": []}
        if mode >= 0:
            state["mode"] = modes[mode].text
        if own.armed is not None:
            state["armed"] = any(start <= end_s <= end for start, end in own.armed)
        if is_off or facts.measurements:
            is_healthy = arrival >= 0 and end_s - facts.arrivals_s[arrival] < UNHEALTHY_S
            state["camera"] = "off" if is_off else "healthy" if is_healthy else "not healthy"
        if status >= 0 and has_flags and own.time_us[status] * 1e-6 >= since_s:
            state["aiding"] = _aiding(int(own.flags[status]))
        if source_set >= 0:
            state["source_set"] = sets[source_set].number - EV_SOURCE_SET_1
        if attitude >= 0 and xkf1.time_s[attitude] >= since_s:
            state["yaw_deg"] = finite(yaw_deg[attitude], 1)
        rates = [counts.row(end_s, facts.start_s) for counts in counted]
        moments.append({"t": state["time_s"], "state": state, "rates": rates})
    return moments


def _aiding(flags: int) -> str:
    if flags & FilterFlag.CONST_POS_MODE or not flags & (FilterFlag.HORIZ_POS_ABS | FilterFlag.HORIZ_POS_REL):
        return "none"
    return "absolute" if flags & FilterFlag.HORIZ_POS_ABS else "relative"


class _Counted:
    """Counts the records of a kind; no log has how many messages were dropped or fused."""

    def __init__(self, name: str, series: Series) -> None:
        self._name, self._time_s, self._tells_ignored = name, series.time_s, series.has("Ign")
        self._ignored = np.concatenate([[0], np.cumsum(series["Ign"] > 0)])

    def row(self, now_s: float, start_s: float) -> dict[str, Any]:
        """Return records per second and in all, as the page has them."""
        first, last = np.searchsorted(self._time_s, (now_s - _WINDOW_S, now_s), side="right").tolist()
        span_s = min(max(now_s - start_s, LOOK_PERIOD_S), _WINDOW_S)
        return {"name": self._name, "per_s": self._counts(first, last, span_s), "total": self._counts(0, last, 1.0)}

    def _counts(self, first: int, last: int, span_s: float) -> dict[str, float | None]:
        ignored = int(self._ignored[last] - self._ignored[first])
        return {
            "offered": None,
            "accepted": round((last - first - ignored) / span_s, 1),
            "fused": None,
            "ignored": round(ignored / span_s, 1) if self._tells_ignored else None,
            "dropped": None,
        }


def _runs(material: Material) -> list[dict[str, Any]]:
    """Return the outcome of measurements, as far as Ign shows it."""
    outcomes: list[tuple[float, str, str]] = []
    for name, series in zip(_RECORDS, material.vision, strict=True):
        why = np.full(len(series), "", dtype=object)
        for reason, mask in withheld_why(material, series).items():
            why[mask] = reason
        outcomes += zip(series.time_s.tolist(), [name] * len(series), why.tolist(), strict=True)
    runs = Runs(None)
    for time_s, name, reason in sorted(outcomes):
        outcome, rule = ("ignored", "Ign 1") if reason else ("accepted", "Ign 0")
        about = {
            "reason": f"withheld from the EKF for {reason}" if reason else "the driver took it",
            "source": name,
            "model": False,
        }
        runs.take(RunKey(material.name, name, "", outcome, rule), about, round(time_s * 1e6))
    return runs.all()


def _table(material: Material, firmware: Firmware) -> Iterator[dict[str, Any]]:
    """Yield the parameters at the end, those that are known with what is known about them."""
    slots: dict[str, ParamSlot] = {}
    last = {parameter.name: parameter for parameter in material.parameters}
    if last:
        groups = make_groups(MAX_LINKS, make_params(), firmware.params)
        slots = {slot.name: slot for group in groups for slot in group.slots}
    for name, parameter in last.items():
        value, slot = np.float32(parameter.value), slots.get(name)
        default = shown(np.float32(parameter.default)) if math.isfinite(parameter.default) else None
        if slot is not None:
            yield row_of(slot, value, {name: shown(slot.raw) if default is None else default})
        else:
            yield {"name": name, "value": shown(value), "default": default, **_UNKNOWN}
