# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The smoother with its landmarks, and the filter that propagates its result from node to frame.

While a body hardly moves, the distance of points is unobservable: there are no landmarks, or wrong ones. The baseline's
filter then replaces the smoother, because it can hold points of unknown distance. Over ground whose height is measured,
plane or not, it does so for good, because it can use such a height.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.klt.front_end import Sighting
from viso.companion.msckf.chain import Chain
from viso.companion.msckf.estimator import WindowEstimator
from viso.companion.msckf.heights import GATE, take_height
from viso.companion.msckf.multi_state import Below, Plane, TracksUsed, relief_of
from viso.companion.msckf.tracks import padded
from viso.companion.msckf.window_filter import Clone, WindowFilter
from viso.companion.smoother.belief import adopt, correction_nis, motion_of, smoother_cov
from viso.companion.smoother.lag_smoother import LAG_S, LagSmoother, LandmarkSighting, SmootherError, preintegrated
from viso.companion.smoother.landmarks import MAX_ERROR_SIGMAS, MIN_PARALLAX_RAD, LandmarkBook
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.imu import bracketed
from viso.companion.vio.types import ImuSample, ImuWindow
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

EARLY_NODES: Final = 4  # the first with landmarks, whose positions are uncertain
EARLY_PASSES: Final = 4
FEWEST_LANDMARKS: Final = 8  # below that, they do not hold the position
STEP_NODES: Final = 4  # in which a body that moves shows landmarks
FILTER_SIGMA_SHARE: Final = 0.5  # points wander less between two pictures than over a landmark's life
_WINDOW_CLONES: Final = 11
_FILTER_SIGHTINGS: Final = 3
_RATIO_KEPT: Final = 0.9
_SIGHTINGS_LAG_NS: Final = round((LAG_S - 0.5) * 1e9)  # none from a node that is about to be forgotten


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A frame for the smoother.

    Attributes:
        number: larger than those before.
        plane: the ground, if all points lie on it or its height right below is known.
        height: height of the body in the world and its sigma, both in m; None if unknown.
        depth_m: a low guess of the distance of points.
    """

    number: int
    t_ns: int
    sighting: Sighting
    is_still: bool = False
    plane: Plane | Below | None = None
    height: tuple[float, float] | None = None
    depth_m: float = 1.0


@dataclass(frozen=True, slots=True)
class NodeFacts:
    """Outcome of a node.

    Attributes:
        begins: whether the smoother restarted with it; it must be a keyframe, because all earlier nodes are gone.
        failed: whether the equations could not be solved.
        is_filtered: whether a filter has replaced the smoother; its points count as landmarks.
        landmarks: seen, new ones among them.
        agreeing: those at their expected place after the solution.
        mre_sigmas: mean reprojection error of those, in sigmas; 0 for none.
        depth_m: median distance of those, along the view; 1 for none.
    """

    begins: bool = False
    failed: bool = False
    is_filtered: bool = False
    landmarks: int = 0
    agreeing: int = 0
    mre_sigmas: float = 0.0
    depth_m: float = 1.0


class SmootherEstimator:
    """A smoother fed by the front end.

    Args:
        state: where to begin.
        sigma: of a normalised coordinate.

    Attributes:
        state: the present state; its last clone is the keyframe, at first the first node.
        innovation_ratio: running mean of the normalised innovation squared per degree of freedom.
        chain: of the poses since the start, None before there is one and after the smoother has restarted.
    """

    def __init__(self, state: WindowFilter, noise: ImuNoise, B_T_C: SE3, sigma: float) -> None:
        self.state = state
        self.innovation_ratio = 1.0
        self.chain: Chain | None = None
        self._B_T_C = B_T_C
        self._sigma = sigma
        self._smoother: LagSmoother | None = None
        self._filter: WindowEstimator | None = None  # while the body hardly moves
        self._used = TracksUsed()  # by that, the last ones
        self._stays = False  # that
        self._book = LandmarkBook(B_T_C, sigma)
        self._noise = noise
        self._restart_imu()
        self._times_ns: dict[int, int] = {}
        self._poses: dict[int, SE3] = {}
        self._nodes_with_landmarks = 0
        self._keyframe = 0

    def propagate(self, window: ImuWindow) -> None:
        """Propagate by inertial data; a gap in them makes the smoother restart."""
        samples = bracketed(window)
        if not self.state.carry_on(window, samples):
            self._smoother = None
            if not self._stays:
                self._filter = None
        for sample in samples:
            if not self._since or sample.t_ns > self._since[-1].t_ns:
                self._since.append(sample)

    def add_node(self, node: Node) -> NodeFacts:
        """Take in a frame.

        If the smoother fails, the state continues on inertial data alone, and the next node restarts from it.
        """
        try:
            if node.plane is not None:
                self._stays, self._filter = True, self._filter or self._stand_in()
            if self._filter is not None:
                return self._go_on(self._filter, node)
            return self._begin(node) if self._smoother is None else self._extend(self._smoother, node)
        except (SmootherError, np.linalg.LinAlgError):
            self._smoother = self._filter = None
            return NodeFacts(failed=True)

    def set_keyframe(self, number: int) -> None:
        """Make the last node the keyframe; until the next node, the state also has the previous one."""
        state, self._keyframe = self.state, number
        if state.clones[-1].number == number:
            return
        for clone in state.clones[:-1]:
            if clone.number not in self._origins():
                state.drop(clone.number)
        state.clone(number)

    def begin_chain(self, keyframe: int) -> None:
        """Begin the chain of poses with the last node, which is relative to a keyframe."""
        number = max(self._times_ns)
        if all(clone.number != number for clone in self.state.clones):
            self.state.clone(number, first=True)
        self.chain = Chain(self.state, number, keyframe)

    def relief_share(self) -> float | None:
        """Return the height differences of points as a share of their distance; None if unknown."""
        tracks = self._book.longest(self._poses)
        if not tracks:
            return None
        clones = [Clone(number, pose.R, pose.t) for number, pose in self._poses.items()]
        arrays = padded(tracks, {clone.number: index for index, clone in enumerate(clones)})
        return relief_of(clones, self._B_T_C, arrays)

    def _origins(self) -> list[int]:
        return [] if self.chain is None else [self.chain.origin]

    def _begin(self, node: Node) -> NodeFacts:
        state, self.chain = self.state, None
        state.release({point.number for point in state.points})
        if not state.clones:
            state.clone(node.number)
        smoother = LagSmoother(self._B_T_C, node.number, 0.0, motion_of(state), smoother_cov(state))
        smoother.solve()
        self._smoother, self._begin_ns, self._keyframe = smoother, node.t_ns, node.number
        self._times_ns, self._poses = {node.number: node.t_ns}, {node.number: state.pose}
        self._book.forget()
        self._book.note(node.number, node.sighting)
        self._nodes_with_landmarks = 0
        self._restart_imu()
        return NodeFacts(begins=True)

    def _extend(self, smoother: LagSmoother, node: Node) -> NodeFacts:
        state = self.state
        expected, expected_cov = motion_of(state), state.cov
        self._remember(node, expected.pose)
        since = preintegrated(self._since, self._noise, self._since_bias)
        smoother.add_node(node.number, (node.t_ns - self._begin_ns) * 1e-9, expected, since)
        if node.is_still:
            smoother.add_stillness()
        if node.height is not None:
            smoother.add_height(*node.height)
        sightings = self._book.note(node.number, node.sighting)
        for new in self._book.discover(self._poses):
            smoother.add_landmark(new.landmark, new.position)
            sightings += new.sightings
        smoother.add_sightings(sightings, self._sigma * math.sqrt(max(1.0, self.innovation_ratio)))
        kept = list(dict.fromkeys([*self._origins(), self._keyframe]))
        smoother.solve(self._passes(), keep=kept)
        adopt(state, smoother.motion(), {number: smoother.pose(number) for number in kept}, smoother.joint_cov(*kept))
        self._poses = {number: smoother.pose(number) for number in self._poses}
        self._restart_imu()
        if not node.is_still:
            nis = correction_nis(expected, expected_cov, motion_of(state), state.cov)
            if nis is not None:
                self.innovation_ratio = _RATIO_KEPT * self.innovation_ratio + (1 - _RATIO_KEPT) * nis
            if self._book.count < FEWEST_LANDMARKS and self._parallax_rad() < MIN_PARALLAX_RAD:
                self._filter = self._stand_in()
                state.clone(node.number)
                self._filter.hold(node.number, node.sighting, node.depth_m)
        return self._judge(smoother, [sighting for sighting in sightings if sighting.number == node.number])

    def _parallax_rad(self) -> float:
        """Return the parallax of the last nodes; NaN if unknown."""
        last = list(self._poses)[-STEP_NODES:]
        return self._book.parallax_rad(self._poses, last) if len(last) == STEP_NODES else math.nan

    def _stand_in(self) -> WindowEstimator:
        """Return a filter that replaces the smoother."""
        self._used = TracksUsed()
        sigma = FILTER_SIGMA_SHARE * self._sigma
        return WindowEstimator(self.state, self._B_T_C, sigma, _WINDOW_CLONES, _FILTER_SIGHTINGS)

    def _go_on(self, filtered: WindowEstimator, node: Node) -> NodeFacts:
        """Add a frame without the smoother, which restarts when the body moves."""
        self._remember(node, self.state.pose)
        self._book.note(node.number, node.sighting)
        self._restart_imu()
        if node.is_still:
            return NodeFacts(is_filtered=True)
        filtered.chain = self.chain
        filtered.compare(node.sighting)
        used = filtered.add_frame(node.number, node.sighting, node.plane, self._keyframe, node.depth_m)
        if node.height is not None:
            take_height(self.state, *node.height, GATE)
        self._poses |= {
            clone.number: SE3(clone.R, clone.p) for clone in self.state.clones if clone.number in self._poses
        }
        self.innovation_ratio = filtered.innovation_ratio
        if not self._stays and self._parallax_rad() >= MIN_PARALLAX_RAD:
            self._filter = None
            return self._begin(node)
        if used.used:
            self._used = used
        held = len(self.state.points)
        return NodeFacts(
            is_filtered=True,
            landmarks=held + used.offered,
            agreeing=held + used.used,
            mre_sigmas=FILTER_SIGMA_SHARE * self._used.mre_sigmas,
            depth_m=self._used.depth_m,
        )

    def _remember(self, node: Node, pose: SE3) -> None:
        times_ns, poses = self._times_ns | {node.number: node.t_ns}, self._poses | {node.number: pose}
        recent = [number for number, t_ns in times_ns.items() if node.t_ns - t_ns <= _SIGHTINGS_LAG_NS]
        self._times_ns = {number: times_ns[number] for number in recent}
        self._poses = {number: poses[number] for number in recent}

    def _passes(self) -> int:
        self._nodes_with_landmarks += self._book.count > 0
        return EARLY_PASSES if self._nodes_with_landmarks <= EARLY_NODES else 1

    def _restart_imu(self) -> None:
        self._since: list[ImuSample] = []
        self._since_bias = self.state.bias

    def _judge(self, smoother: LagSmoother, sightings: list[LandmarkSighting]) -> NodeFacts:
        """Compare sightings of landmarks with predictions, and remove landmarks that do not fit."""
        if not sightings:
            return NodeFacts()
        camera_T_world = (self.state.pose @ self._B_T_C).inverse()
        local = camera_T_world.map(smoother.points(sighting.landmark for sighting in sightings))
        depth = np.where(local[:, 2] > 0, local[:, 2], np.nan)
        normalised = np.array([sighting.normalised for sighting in sightings])
        error: Array = np.linalg.norm(local[:, :2] / depth[:, None] - normalised, axis=1) / self._sigma
        good = error < MAX_ERROR_SIGMAS  # not so for NaN, behind the camera
        self._book.drop(
            {sighting.landmark for sighting, is_good in zip(sightings, good.tolist(), strict=True) if not is_good}
        )
        if not good.any():
            return NodeFacts(landmarks=len(sightings))
        return NodeFacts(
            landmarks=len(sightings),
            agreeing=int(np.count_nonzero(good)),
            mre_sigmas=float(error[good].mean()),
            depth_m=float(np.median(depth[good])),
        )
