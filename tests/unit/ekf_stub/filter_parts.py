# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a filter, to be tested one by one."""

from collections import Counter
from typing import Any

import numpy as np
import quaternion

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.filter.attitude import quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.output_predictor import OutputPredictor
from ekf_stub.fusion import parts
from ekf_stub.fusion.aiding import Aiding
from ekf_stub.fusion.body_odometry import BodyOdometry
from ekf_stub.fusion.flow_fusion import FlowFusion
from ekf_stub.fusion.height_source import HeightSource
from ekf_stub.fusion.measurements import Delayed, Pose, Velocity
from ekf_stub.fusion.origin_height import OriginHeight
from ekf_stub.fusion.resets import Resets
from ekf_stub.fusion.terrain import Terrain
from ekf_stub.fusion.vel_pos_fusion import VelPosFusion
from ekf_stub.fusion.yaw_fusion import YawFusion
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ext_nav_ingest import ExtNavIngest, FilterOutcome
from ekf_stub.inputs.flow_ingest import FlowIngest
from ekf_stub.inputs.gps_reading import GpsReading
from ekf_stub.inputs.obs_ring import RingSizes
from ekf_stub.inputs.range_reading import RangeReading
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.reports.core_texts import CoreTexts
from viso.parameters.table import make_groups

SOURCES = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")


class FilterParts:
    """The parts of a filter without what runs them: level and at rest, with sources and parameters as given.

    Attributes:
        said: severity and text of all that was said, flushed or not.
        outcomes: kind, code and ratio of all that became of samples once they were taken.
    """

    def __init__(self, sources: str, params: dict[str, float]) -> None:
        table = ParamTable(make_groups(0, make_params()))
        for what, value in zip(SOURCES, sources, strict=True):
            table.set(f"EK3_SRC1_{what}", int(value))
        for name, number in params.items():
            table.set(f"EK3_{name}", number)
        self.params = table
        self.get = get = lambda name: table.get_number(f"EK3_{name}")
        self.said: list[tuple[int, str]] = []
        self.counts: Counter[tuple[str, str]] = Counter()
        self.outcomes: list[tuple[str, str, Any]] = []
        self.has_compass = True
        self.texts = CoreTexts(self, (0,))
        self.sources = EkfSources(lambda name: table.get_int(f"EK3_{name}"))
        self.ingest = ExtNavIngest(self.counts, get)
        self.ingest.set_up(RingSizes(6, 5, 2))
        self.ingest.initialised = True
        self.ingest.on_outcome = self._take_outcome
        self.gps = GpsReading(get, 3)
        self.origin_height = OriginHeight()
        self.state = ErrorState(quaternion.one, np.array([0.3, 0.3, 0.5, 0.5, 0.5, 2.0]) ** 2)
        self.output = OutputPredictor(self.state, 6)
        self.aiding = Aiding()
        self.delayed = Delayed(self.ingest)
        shared = parts.FilterParts(
            state=self.state,
            output=self.output,
            aiding=self.aiding,
            sources=self.sources,
            delayed=self.delayed,
            ingest=self.ingest,
            gps=self.gps,
            origin_height=self.origin_height,
            texts=self.texts,
            get_float=get,
            has_compass=lambda: self.has_compass,
            ring_size=3,
        )
        self.resets = Resets(shared)
        self.ranges = RangeReading(4)
        self.flow_ingest = FlowIngest(5)
        self.terrain = Terrain(shared, self.ranges, 0)
        self.height = HeightSource(shared, self.terrain)
        self.fusion = VelPosFusion(shared, self.resets, self.height)
        self.flow = FlowFusion(shared, self.flow_ingest, self.terrain)
        self.yaw = YawFusion(shared, self.resets, self.fusion.innovations)
        self.odometry = BodyOdometry(shared)

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        self.said.append((severity, text))

    def _take_outcome(self, outcome: FilterOutcome) -> None:
        if outcome.rule is not rules.TAKEN:
            self.outcomes.append((outcome.kind, outcome.rule.code, outcome.ratio))

    def told(self) -> list[str]:
        """Return what was said since the last call, without the core."""
        self.texts.flush()
        texts = [text.removeprefix("EKF3 IMU0 ") for _, text in self.said]
        self.said.clear()
        return texts

    def set_pose(self, *pos: float, err: float = 0.2, is_reset: bool = False, time_ms: int = 0) -> None:
        """Let a pose have come due in this step."""
        self.delayed.pose = Pose(time_ms, np.array(pos), err, is_reset)
        self.delayed.has_pose = True

    def set_velocity(self, *vel: float, err: float = 0.1, time_ms: int = 0) -> None:
        """Let a velocity have come due in this step, and with it the first of all."""
        self.delayed.velocity = Velocity(time_ms, np.array(vel), err)
        self.delayed.has_velocity = self.ingest.have_velocity = True

    def end_step(self) -> None:
        """Let nothing have come due in the next step."""
        self.delayed.has_pose = self.delayed.has_velocity = False

    def turn_to(self, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> None:
        """Let the filter hold an attitude to be true, rad."""
        self.state.quat = quat_of_euler(roll, pitch, yaw)
        self.state.rotation = self.state.rotation_now()
