# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recomputes recorded firmware behaviour: scenarios of the library, maths calls, jitter sequences.

A line of a recording has inputs and the firmware's outputs. Here the port gets the same inputs, and the line is written
with its outputs. The recorded outputs are not read.
"""

import operator
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Final

import numpy as np

from ap_core.clock import VirtualClock
from ap_core.fmath import cbrtf, f32, wrap_2pi, wrap_360, wrap_pi
from ap_core.internal_error import InternalError
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.matrix3 import Matrix3f
from ap_core.quaternion import Quaternion
from ap_core.rotations import quaternion_from_rotation, rotate_vector
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ap_visualodom.release import STABLE_4_7, VisualOdomRelease
from ekf_stub.ahrs.ahrs_settable import BodyFrameOdom, ExtNav, ExtNavCall, SettableAhrs
from mav_handlers.jitter_correction import JitterCorrection
from viso.documents import parsed_json
from viso.files.float_bits import bits_of, float_of, floats_of, json_value, quaternion_of, vector_of

Out = list[object]


class VectorError(ValueError):
    """A line has no known form; the text gives the reason."""


_MALFORMED: Final = (TypeError, KeyError, ValueError, OverflowError)


def _integer(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"not an integer: {value!r}")
    return value


def _check_integers(*values: object) -> None:
    for value in values:
        _integer(value)


def _no_error(_error: InternalError, _line: int = 0, /) -> None:
    return None


def _bits(values: Sequence[np.float32]) -> Out:
    return [bits_of(value) for value in values]


def _call_output(call: ExtNavCall) -> Out:
    if isinstance(call, ExtNav):
        pos, quat = _bits(call.pos.to_tuple()), _bits(call.quat.to_wxyz())
        errors = _bits((call.posErr, call.angErr))
        return ["extnav", pos, quat, *errors, call.timeStamp_ms, call.delay_ms, call.resetTime_ms]
    if isinstance(call, BodyFrameOdom):
        deltas = [_bits(call.delPos.to_tuple()), _bits(call.delAng.to_tuple()), bits_of(call.delTime)]
        times = [call.timeStamp_ms, call.delay_ms]
        return ["odom", bits_of(call.quality), *deltas, *times, _bits(call.posOffset.to_tuple())]
    return ["extvel", _bits(call.vel.to_tuple()), bits_of(call.err), call.timeStamp_ms, call.delay_ms]


class Scenario:
    """A fresh vehicle's AP_VisualOdom, driven step by step; ``run`` returns what each step caused.

    ``params`` are VISO_ values without the prefix: floats in hex, ``POS`` a list of three. Raises VectorError if one
    has no known form.
    """

    def __init__(self, params: dict[str, object], release: VisualOdomRelease = STABLE_4_7) -> None:
        self._clock = VirtualClock()
        self._ahrs = SettableAhrs()
        self._out: Out = []
        self._params = make_params()
        try:
            for name, value in params.items():
                self._set_param(name, value)
        except _MALFORMED as error:
            raise VectorError(str(error)) from error
        self._visual_odom = AP_VisualOdom(
            self._params,
            ahrs=self._ahrs,
            gcs=self,
            logger=self,
            clock=self._clock,
            errors=self._error,
            release=release,
        )
        self._visual_odom.init()

    def send_text(self, severity: int, text: str) -> None:
        """Record a text of the library (TextSink)."""
        self._collect_calls()
        self._out.append(["text", severity, text])

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Record a log record of the library (RecordSink)."""
        self._collect_calls()
        self._out.append(["log", structure.name, *map(json_value, values)])

    def _error(self, _error: InternalError, _line: int = 0, /) -> None:
        self._collect_calls()
        self._out.append(["internal_error"])

    def _collect_calls(self) -> None:
        calls, self._ahrs.calls = self._ahrs.calls, []
        self._out.extend(_call_output(call) for call in calls)

    def _set_param(self, name: str, value: object) -> None:
        if name == "POS":
            self._params.set("_POS", vector_of(value))
        elif isinstance(value, str):
            self._params.set(f"_{name}", float_of(value))
        elif isinstance(value, int):
            self._params.set(f"_{name}", value)
        else:
            raise VectorError(f"parameter {name}: neither an integer nor a float in hex: {value!r}")

    def run(self, step: Sequence[object]) -> Out:
        """Do one step and return its outputs. Raises VectorError if the step has no known form."""
        if not step:
            raise VectorError("no operation")
        op, *args = step
        method = _OPS.get(str(op))
        if method is None:
            raise VectorError(f"unknown step {op!r}")
        try:
            method(self, *args)
        except _MALFORMED as error:
            raise VectorError(f"step {op!r}: {error}") from error
        self._collect_calls()
        out, self._out = self._out, []
        return out

    def _time_us(self, time_us: int) -> None:
        _check_integers(time_us)
        self._clock.set_us(time_us)

    def _ahrs_answers(self, answers: dict[str, object]) -> None:
        self._ahrs.is_initialised = bool(answers["initialised"])
        self._ahrs.is_dcm_yaw_initialised = bool(answers["dcm_yaw_initialised"])
        self._ahrs.is_using_extnav_for_yaw = bool(answers["using_extnav_for_yaw"])
        self._ahrs.yaw = float_of(answers["yaw"])
        self._ahrs.quat = None if answers["quat"] is None else quaternion_of(answers["quat"])
        self._ahrs.pos = None if answers["pos"] is None else vector_of(answers["pos"])

    def _pose(
        self,
        remote_us: int,
        time_ms: int,
        pos: object,
        attitude: object,
        pos_err: object,
        ang_err: object,
        reset_counter: int,
        quality: int,
        *,
        by_euler: bool = False,
    ) -> None:
        _check_integers(remote_us, time_ms, reset_counter, quality)
        errors, place = (float_of(pos_err), float_of(ang_err)), vector_of(pos)
        if by_euler:
            self._visual_odom.handle_pose_estimate_euler(
                remote_us, time_ms, place, vector_of(attitude), *errors, reset_counter, quality
            )
        else:
            self._visual_odom.handle_pose_estimate(
                remote_us, time_ms, place, quaternion_of(attitude), *errors, reset_counter, quality
            )

    def _speed(self, remote_us: int, time_ms: int, vel: object, reset_counter: int, quality: int) -> None:
        _check_integers(remote_us, time_ms, reset_counter, quality)
        self._visual_odom.handle_vision_speed_estimate(remote_us, time_ms, vector_of(vel), reset_counter, quality)

    def _delta(self, _time_us: int, delta_us: int, angle: object, position: object, confidence: object) -> None:
        _check_integers(delta_us)
        self._visual_odom.handle_vision_position_delta_msg(
            delta_us, vector_of(angle), vector_of(position), float_of(confidence)
        )

    def _request_align_yaw(self) -> None:
        self._visual_odom.request_align_yaw_to_ahrs()

    def _align_position(self, xy: bool, z: bool) -> None:
        self._visual_odom.align_position_to_ahrs(bool(xy), bool(z))

    def _pre_arm_check(self) -> None:
        text = self._visual_odom.pre_arm_check()
        self._out.append(["prearm", text is None, text or ""])

    def _status(self) -> None:
        frontend = self._visual_odom
        self._out.append(["status", frontend.enabled(), frontend.healthy(), frontend.quality()])


_OPS: Final[dict[str, Callable[..., None]]] = {
    "time_us": Scenario._time_us,
    "ahrs": Scenario._ahrs_answers,
    "pose": Scenario._pose,
    "pose_euler": partial(Scenario._pose, by_euler=True),
    "speed": Scenario._speed,
    "delta": Scenario._delta,
    "request_align_yaw": Scenario._request_align_yaw,
    "align_position": Scenario._align_position,
    "param": Scenario._set_param,
    "pre_arm_check": Scenario._pre_arm_check,
    "status": Scenario._status,
}


def _wrap_wide(wrap: Callable[[float], float]) -> Callable[[object], Sequence[np.float32]]:
    return lambda x: [f32(wrap(float(float_of(x))))]


def _cube_root_of_squares(values: object) -> Sequence[np.float32]:
    return [cbrtf(reduce(operator.add, (value * value for value in floats_of(values, 3))))]


_MATHS: Final[dict[str, Callable[..., Sequence[np.float32]]]] = {
    "q_from_rotation": lambda rot: quaternion_from_rotation(_integer(rot), _no_error).to_wxyz(),
    "v_rotate": lambda rot, v: rotate_vector(vector_of(v), _integer(rot), _no_error).to_tuple(),
    "q_from_euler": lambda e: Quaternion.from_euler(*floats_of(e, 3)).to_wxyz(),
    "q_to_euler": lambda q: quaternion_of(q).to_euler(),
    "q_mul": lambda a, b: (quaternion_of(a) * quaternion_of(b)).to_wxyz(),
    "q_rotvec": lambda q, v: quaternion_of(q).rotate_vector(vector_of(v)).to_tuple(),
    "rp_diff": lambda a, b: [quaternion_of(a).roll_pitch_difference(quaternion_of(b), _no_error)],
    "ang_diff_axis": lambda a, b: quaternion_of(a).angular_difference(quaternion_of(b)).to_axis_angle().to_tuple(),
    "m_from_euler_mul": lambda e, v: (Matrix3f.from_euler(*floats_of(e, 3)) * vector_of(v)).to_tuple(),
    "wrap_2PI": _wrap_wide(wrap_2pi),
    "wrap_PI": _wrap_wide(wrap_pi),
    "wrap_360": lambda x: [wrap_360(float_of(x))],
    "poserr": _cube_root_of_squares,
    "v_length": lambda v: [vector_of(v).length()],
}


def _recompute_scenario(line: dict[str, object], release: VisualOdomRelease) -> dict[str, object]:
    params, steps = line.get("params"), line["steps"]
    if not isinstance(params, dict) or not isinstance(steps, list):
        raise VectorError("a scenario needs an object 'params' and a list 'steps'")
    scenario = Scenario(params, release)
    done: list[object] = []
    for number, step in enumerate(steps):
        if not isinstance(step, list) or not step:
            raise VectorError(f"step {number}: not a list")
        bare = step[:-1] if isinstance(step[-1], dict) and "out" in step[-1] else step
        try:
            done.append([*bare, {"out": scenario.run(bare)}])
        except VectorError as error:
            raise VectorError(f"step {number}: {error}") from error
    return {**line, "steps": done}


def _recompute_jitter(line: dict[str, object]) -> dict[str, object]:
    samples = line["samples"]
    max_lag_ms, loops = line.get("max_lag_ms"), line.get("convergence_loops")
    if not isinstance(samples, list) or not isinstance(max_lag_ms, int) or not isinstance(loops, int):
        raise VectorError("a jitter sequence needs 'samples', 'max_lag_ms' and 'convergence_loops'")
    corrector = JitterCorrection(max_lag_ms, loops)
    done = []
    for number, sample in enumerate(samples):
        if not isinstance(sample, list) or not all(isinstance(x, int) for x in sample[:2]) or len(sample) < 2:
            raise VectorError(f"sample {number}: not [remote_us, arrival_us, ...]: {sample!r}")
        remote_us, arrival_us = sample[:2]
        done.append([remote_us, arrival_us, corrector.correct_offboard_timestamp_usec(remote_us, arrival_us)])
    return {**line, "samples": done}


def _recompute_maths(line: list[object]) -> list[object]:
    if len(line) < 2 or not isinstance(line[1], list):
        raise VectorError("a maths call is [function, [arguments...], result]")
    function, args = str(line[0]), line[1]
    if function not in _MATHS:
        raise VectorError(f"unknown function {function!r}")
    try:
        return [function, args, _bits(_MATHS[function](*args))]
    except (TypeError, ValueError) as error:
        raise VectorError(f"{function}: {error}") from error


def recompute(line: object, release: VisualOdomRelease = STABLE_4_7) -> object:
    """Return a recorded line with its outputs computed by the port.

    It is a scenario (object with ``steps``), a jitter sequence (object with ``samples``) or a maths call (list); only
    scenarios differ between releases of the library. Raises VectorError if it has none of these forms.
    """
    with np.errstate(all="ignore"):
        if isinstance(line, list):
            return _recompute_maths(line)
        if isinstance(line, dict) and "steps" in line:
            return _recompute_scenario(line, release)
        if isinstance(line, dict) and "samples" in line:
            return _recompute_jitter(line)
    raise VectorError("neither a scenario, a jitter sequence nor a maths call")


def parse_line(text: str) -> object:
    """Return a line of a recording, from its text. Raises VectorError if it is not JSON."""
    try:
        return parsed_json(text)
    except ValueError as error:
        raise VectorError(str(error)) from error
