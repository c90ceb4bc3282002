# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared base without I/O: float32 maths, C integers, clock, parameters and DataFlash records."""

from ap_core.clock import Clock, VirtualClock
from ap_core.internal_error import InternalError, InternalErrors
from ap_core.matrix3 import Matrix3f
from ap_core.param import ParamTable
from ap_core.quaternion import Quaternion
from ap_core.sinks import RecordSink, TextSink
from ap_core.vector3 import Vector3f
from ap_core.verdict import Rule, Verdict, VerdictKind

__all__ = [
    "Clock",
    "InternalError",
    "InternalErrors",
    "Matrix3f",
    "ParamTable",
    "Quaternion",
    "RecordSink",
    "Rule",
    "TextSink",
    "Vector3f",
    "Verdict",
    "VerdictKind",
    "VirtualClock",
]
