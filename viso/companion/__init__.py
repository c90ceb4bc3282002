# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion computer's side of the wire."""

from viso.companion.odometry.sender import OdometrySender
from viso.companion.odometry.source import OdometrySource
from viso.companion.sender import OffsetClock
from viso.companion.vio.config import VioConfig, load_config
from viso.companion.vio.errors import StrategyNotAvailableError, VioError, VioFatalError
from viso.companion.vio.health import FrameFacts, Growth
from viso.companion.vio.pipeline import StrategyBase, StrategyContext
from viso.companion.vio.registry import STRATEGIES, StrategyEntry, build_vio_strategy
from viso.companion.vio.result import Degraded, Initializing, Lost, Result, Tracking
from viso.companion.vio.types import (
    CameraCalibration,
    FeatureQuality,
    ImuBias,
    ImuSample,
    ImuWindow,
    NavCameraFrame,
    VioHealth,
    VioOutput,
    VioState,
    WarmStartPose,
)
from viso.geometry.pose import SE3

__all__ = [
    "SE3",
    "STRATEGIES",
    "CameraCalibration",
    "Degraded",
    "FeatureQuality",
    "FrameFacts",
    "Growth",
    "ImuBias",
    "ImuSample",
    "ImuWindow",
    "Initializing",
    "Lost",
    "NavCameraFrame",
    "OdometrySender",
    "OdometrySource",
    "OffsetClock",
    "Result",
    "StrategyBase",
    "StrategyContext",
    "StrategyEntry",
    "StrategyNotAvailableError",
    "Tracking",
    "VioConfig",
    "VioError",
    "VioFatalError",
    "VioHealth",
    "VioOutput",
    "VioState",
    "WarmStartPose",
    "build_vio_strategy",
    "load_config",
]
