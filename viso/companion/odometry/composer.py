# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From poses relative to keyframes to a pose in one local frame.

The local frame L has z up and its origin in the first pose: with north as its alignment it is ENU, else x points along
the first heading. It is converted to NED or LOCAL_FRD only for the message, see :mod:`viso.companion.odometry.message`.
"""

import dataclasses
import uuid
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.vio.config import LocalAlignment
from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD
from viso.companion.vio.types import VioOutput
from viso.geometry.pose import SE3, sound_covariance
from viso.geometry.rotation import Array, so3_exp, yaw_of

AGL_SCALE_SIGMA: Final = 0.02
JUMP_M: Final = 0.5
JUMP_RAD: Final = 0.1
BLENDED_SHARE: Final = 0.1  # of what is left of a refinement, with each output


def local_to_frd(alignment: LocalAlignment) -> Array:
    """Return the matrix from L to the axes of the message: NED, or x along the first heading, y right, z down."""
    return ENU_TO_NED if alignment is LocalAlignment.NORTH else FLU_TO_FRD


@dataclass(frozen=True, slots=True, eq=False)
class LocalPose:
    """The body in the local frame.

    Attributes:
        covariance_6x6: of it, right perturbation, (rx, ry, rz, tx, ty, tz).
    """

    L_T_B: SE3
    covariance_6x6: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Keyframe:
    frame_id: uuid.UUID
    L_T_K: SE3
    covariance_6x6: Array


class OdometryComposer:
    """Keeps the last keyframe's pose and covariance, and composes each output with them.

    When a strategy refines a keyframe, the poses follow: at once if the keyframe moves by more than 0.5 m or 0.1 rad,
    else by a tenth of the rest with each output. The covariance stays unchanged, because that of the refined pose is
    unknown.

    If a strategy states the covariance of all its relative poses together, that is used; else they are taken
    to err independently.

    Args:
        alignment: of the local frame; None for north if the heading is known at the first pose, else the first heading.
        world_is_north: whether the strategy's world has an absolute yaw; else the autopilot's yaw is needed.
        agl_scale_sigma: relative error of the scale, constant over the flight, as from a wrong height above ground.

    Attributes:
        alignment: of the local frame, once it is known.
        jumps: number of outputs that moved the keyframe at once.
    """

    def __init__(
        self,
        alignment: LocalAlignment | None = None,
        *,
        world_is_north: bool = False,
        agl_scale_sigma: float = AGL_SCALE_SIGMA,
    ) -> None:
        self.alignment = alignment
        self._world_is_north = world_is_north
        self._agl_scale_sigma = agl_scale_sigma
        self._keyframe: _Keyframe | None = None
        self._L_T_W = SE3.identity()
        self._began = SE3.identity()  # L_T_W when the local frame, or its last part, began
        self._to_blend: Array = np.zeros(6)  # the rest of the keyframe's refinement, in its own axes
        self.jumps = 0
        self._start, self._start_covariance = SE3.identity(), np.zeros((6, 6))

    @property
    def up(self) -> Array:
        """The vertical in the local frame, from the last output; the strategy keeps estimating it from gravity."""
        return self._L_T_W.R[:, 2]

    def knows(self, keyframe_id: uuid.UUID) -> bool:
        """Return whether poses relative to a keyframe can be composed."""
        return self._keyframe is not None and self._keyframe.frame_id == keyframe_id

    def anchor(self, output: VioOutput, body_yaw_rad: float | None = None) -> bool:
        """Make the local frame from the first output, and return whether that was possible.

        It is not while the frame is to be aligned to north and north is not known.

        Args:
            output: the vertical of its world is taken as true.
            body_yaw_rad: ENU yaw of the body at that time, from the autopilot, None while unknown.
        """
        world_T_body = _normalised(output.world_T_body)
        if self.alignment is None:
            known = self._world_is_north or body_yaw_rad is not None
            self.alignment = LocalAlignment.NORTH if known else LocalAlignment.HEADING0
        if self.alignment is LocalAlignment.HEADING0:
            turn_rad = -yaw_of(world_T_body.R)
        elif self._world_is_north:
            turn_rad = 0.0
        elif body_yaw_rad is not None:
            turn_rad = body_yaw_rad - yaw_of(world_T_body.R)
        else:
            return False
        turned = so3_exp(np.array([0.0, 0.0, turn_rad])).dot(world_T_body.R)
        self.restart(output, LocalPose(SE3(turned, np.zeros(3)), np.zeros((6, 6))))
        return True

    def place_in_world(self, output: VioOutput) -> SE3:
        """Return an output's world pose in the local frame, if its world is that of the last composed output."""
        return self._L_T_W @ _normalised(output.world_T_body)

    def restart(self, output: VioOutput, pose: LocalPose) -> None:
        """Restart from another pose, whose relation to the last keyframe is not known.

        Args:
            output: the first one that refers to the new keyframe.
            pose: the body at that time, with its covariance; the output's own covariance is added.
        """
        K_T_B = _normalised(output.relative_pose_T)
        to_keyframe = K_T_B.adjoint()
        covariance = to_keyframe.dot(pose.covariance_6x6).dot(to_keyframe.T)
        self._keyframe = _Keyframe(output.keyframe_id, pose.L_T_B @ K_T_B.inverse(), covariance)
        self._began = pose.L_T_B @ _normalised(output.world_T_body).inverse()
        self._to_blend = np.zeros(6)
        self._start, self._start_covariance = pose.L_T_B, pose.covariance_6x6

    def compose(self, output: VioOutput) -> LocalPose | None:
        """Return the pose that an output gives; None if its keyframe is not known or no sound covariance comes out."""
        keyframe = self._keyframe
        if keyframe is None or keyframe.frame_id != output.keyframe_id:
            return None
        K_T_B = _normalised(output.relative_pose_T)
        self._keyframe = keyframe = self._refine(keyframe, output.world_T_keyframe)
        L_T_B = _normalised(keyframe.L_T_K @ K_T_B)
        to_body = K_T_B.inverse().adjoint()
        covariance = to_body.dot(keyframe.covariance_6x6).dot(to_body.T) + output.pose_covariance_6x6
        if output.start_covariance_6x6 is not None:
            to_start = (self._start.inverse() @ L_T_B).inverse().adjoint()
            covariance = to_start.dot(self._start_covariance).dot(to_start.T) + output.start_covariance_6x6
        stated = sound_covariance(covariance + self._scale_covariance(L_T_B))
        if stated is None:
            return None
        if output.is_keyframe:
            self._keyframe = _Keyframe(output.frame_id, L_T_B, 0.5 * (covariance + covariance.T))
            self._to_blend = to_body.dot(self._to_blend)
        self._L_T_W = L_T_B @ _normalised(output.world_T_body).inverse()
        return LocalPose(L_T_B, stated)

    def compose_alone(self, output: VioOutput | None) -> LocalPose | None:
        """Return the pose that an output gives; where its keyframe is not known, the local frame begins with it."""
        if output is None:
            return None
        if not self.knows(output.keyframe_id):
            self.anchor(output)
        return self.compose(output)

    def _refine(self, keyframe: _Keyframe, world_T_keyframe: SE3 | None) -> _Keyframe:
        """Return a keyframe at its refined pose."""
        if world_T_keyframe is not None:
            better = self._began @ _normalised(world_T_keyframe)
            self._to_blend = (keyframe.L_T_K.inverse() @ better).log()
        turn, shift = self._to_blend[:3], self._to_blend[3:]
        if not self._to_blend.any():
            return keyframe
        jumps = bool(np.linalg.norm(shift) > JUMP_M or np.linalg.norm(turn) > JUMP_RAD)
        self.jumps += jumps
        moved = (1.0 if jumps else BLENDED_SHARE) * self._to_blend
        self._to_blend = self._to_blend - moved
        return dataclasses.replace(keyframe, L_T_K=keyframe.L_T_K @ SE3.exp(moved))

    def _scale_covariance(self, L_T_B: SE3) -> Array:
        # The error of the scale is the same at every step: it grows with the way from the origin, not with its root,
        # and so it is added to what is stated and never to what is kept.
        error = np.zeros(6)
        error[3:] = self._agl_scale_sigma * L_T_B.R.T.dot(L_T_B.t)
        return np.outer(error, error)


def _normalised(pose: SE3) -> SE3:
    # Each factor may be off by 1e-6, which would accumulate over many keyframes.
    return SE3.from_quat_wxyz(pose.quat_wxyz(), pose.t)
