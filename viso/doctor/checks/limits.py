# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The thresholds by which checks decide: each with its unit, its value, and the reason.

A ``SHARE``, a ``RATIO`` and ``TIMES`` are of what the reason says; ``FEWEST`` is a count. Where the firmware does not
set a value, it was found on recorded flights with planted faults, so that clean flights give no warning.
"""

import math
from typing import Final

# The firmware's own limits.

HEALTHY_US: Final = 300_000
"""AP_VisualOdom_Backend::healthy: without a message for longer, the sensor is unhealthy."""
FRESH_US: Final = 500_000
"""NavEKF3_core::selectHeightForFusion: after longer, the height comes from the barometer."""
STATUS_NEAR_US: Final = 2_000_000
"""An older SYS_STATUS does not tell how the sensor is."""
POSITION_LOST_US: Final = 7_000_000
"""NavEKF3_core::setAidingMode: without a position for longer, the filter gives it up."""
END_TOGETHER_US: Final = 2_000_000
"""A sender that falls silent so shortly before the recording's end was stopped with it, as a rule."""
AIDING_STOPS_US: Final = 15_000_000
"""NavEKF3_core::setAidingMode: without anything for longer, the filter stops aiding."""
FAST_PERIOD_US: Final = 19_500
"""NavEKF3_core::writeExtNavData drops what comes within 20 ms of the sample before; less half a ms for rounding."""
MOST_LAG_MS: Final = 500.0
"""JitterCorrection allows no larger lag; what is later counts as younger than it is."""
CLOCKS_APART_US: Final = 500_000
"""The same limit: of clocks that lie further apart, one makes all samples of the other 500 ms old."""
VISO_DELAY_RANGE_MS: Final = (0, 250)
"""The range of VISO_DELAY_MS in AP_VisualOdom::var_info."""
ATTITUDE_OFF_RAD: Final = math.radians(10)
"""AP_VisualOdom_IntelT265::pre_arm_check refuses to arm beyond 10 deg of roll and pitch, or of yaw."""
FLOW_UNHEALTHY_US: Final = 500_000
"""AP_OpticalFlow: without flow for longer, the sensor is unhealthy."""
FLOW_STOPS_US: Final = 5_000_000
"""NavEKF3_core::setAidingMode: without flow for longer, aiding by flow alone stops."""
FLOW_SLOW_US: Final = 200_000
"""NavEKF3_core::readyToUseOptFlow: aiding does not begin on older flow."""
FLOW_AVERAGE_MS: Final = 50.0
"""NavEKF3_core::writeOptFlowMeas dates flow as an average over 100 ms, half of it before."""
FLOW_DROPPED_RAD_S: Final = 4.2
"""NavEKF3_core::writeOptFlowMeas drops faster flow."""
FLOW_FUSED_RAD_S: Final = 2.5
"""The default of EK3_FLOW_MAX, EK3_MAX_FLOW before: faster flow is not fused."""
RANGE_STALE_US: Final = 500_000
"""NavEKF3_core::selectHeightForFusion: without a good range for longer, the height comes from the barometer."""

# XN1: transport.

FEWEST_LOST: Final = 3
"""One or two lost messages or repeated ones happen on any link."""
LOST_SHARE: Final = 0.02
"""Of the messages of a track: the filter does not miss one in fifty."""

# XN2: frames and axes.

FITS_CORRELATION: Final = 0.9
"""Below it velocities and path do not fit well enough to show axes or scale."""
BETTER_CORRELATION: Final = 0.01
"""A more complicated mix-up has to fit better by this, or noise would choose it."""
HEADING_TURNED_RAD: Final = math.radians(8)
"""Less cannot be distinguished from noise, or from a right angle, which is a matter of axes."""
ZERO_SPEED_SHARE: Final = 0.02
"""Of the speed of the path: velocities below it are not filled in."""
ON_ITS_SIDE_RAD: Final = (math.radians(60), math.radians(120))
"""A tilt between these is a right angle and what a vehicle leans; beyond it the body is upside down."""
ON_ITS_SIDE_SHARE: Final = 0.8
"""Of the attitudes of a recording: a vehicle does not fly on its side so long."""
LEVEL_TIMES_NOISE: Final = 2.0
"""Times its noise: a climb that a barometer shows."""
LEAST_CLIMB_M: Final = 0.5
"""In a smaller climb the noise of heights hides which way is up."""
MIRRORED_CORRELATION: Final = -0.7
"""Below it z and height go opposite ways; noise alone does not come so far."""
FEWEST_HEIGHTS: Final = 20
"""Poses with a known height of the vehicle: fewer show no correlation."""
FEWEST_AT_REST: Final = 5
"""So many first poses must stand still before a start from the ground is believed."""
REST_M: Final = 0.1
"""Within it they stand still: an odometry's noise is some centimetres."""
LEAST_SINKING_M: Final = 0.7
"""Less is a vehicle that was lifted off a table or a stand."""
MOST_RISE_SHARE: Final = 0.15
"""Of what it sinks: a vehicle that takes off rises more than its noise, if z is down."""

# XN3: time.

LEAST_DRIFT_PPM: Final = 2000.0
"""Samples are off by 5 ms in 100 samples at 40 Hz then, the corrector's window; a quartz has 100 ppm."""
CLOCK_FAR_OFF: Final = 0.04
"""Of the rate: samples are off by 100 ms in 100 samples at 40 Hz then, the corrector's window."""
CLOCK_TIMES_TOO_FAST: Final = 2.0
"""From here on a clock is said to run so many times too fast."""
UNIT_WITHIN: Final = (0.8, 1.25)
"""Times the expected rate of stamps; units are a factor of 1000 apart."""
LATE_MARGIN_MS: Final = 10.0
"""Beyond the filter's horizon: about one step of it."""
LATE_SHARE: Final = 0.02
"""Of the messages of a track: single late messages harm nobody."""
DELAY_TOLERANCE_MS: Final = 15.0
"""One step of the filter and some jitter: a smaller error of VISO_DELAY_MS does not show."""
SAME_DELAY_MS: Final = 4
"""If the transport takes no longer, both advised values are as good as one."""
BURST_GAP_US: Final = 5000
"""Messages that arrive closer together waited for each other."""
BURST_SPREAD_US: Final = 50_000
"""By their stamps: more than the period of a usual camera."""
FEWEST_IN_BURST: Final = 3
"""Two messages together are one that came a little late."""
BURST_SHARE: Final = 0.05
"""Of the messages of a track that came in bursts."""

# XN4: rate.

SLOW_PERIOD_US: Final = 250_000
"""A message that is a little late then makes the sensor unhealthy, after 300 ms."""
BURST_INTERVAL: Final = 0.7
"""Of the mean interval: where the middle one is shorter, messages come in bursts, or with gaps between."""
FEW_PERIOD_US: Final = 100_000
"""The advice is 10 messages per second, or more."""
TOO_SOON_SHARE: Final = 0.05
"""Of the samples: single messages out of step are no pairs."""
TWICE_SHARE: Final = 0.5
"""Of the seconds in which a message came: two messages that come in fewer of them take turns."""
FEWEST_TWICE_S: Final = 3
"""Seconds in which both came: fewer may be a switch from one to the other."""

# XN5: numbers.

HUGE_ERROR_M: Final = 10.0
"""From it on a sample has nearly no weight."""
MOST_ANGLE_RAD: Final = 6.4
"""A full turn is 6.28 rad: larger angles are in degrees."""
NORM_TOLERANCE: Final = 0.02
"""Of the length of a quaternion: rounding to float32 takes a millionth of it."""
FROZEN_US: Final = 500_000
"""A pose that is the same to the last bit for less may be one that was sent again."""
THAW_M: Final = 0.2
"""A pose that goes on from further away was not at rest meanwhile."""
MOST_BRAKING_M_S2: Final = 20.0
"""No vehicle with a camera brakes harder."""
UNIT_CORRELATION: Final = 0.7
"""Of velocities with the path: a wrong unit shows even in noisy ones."""
UNIT_SCALE_WITHIN: Final = (0.7, 1.4)
"""Times the factor of a unit: the scale may be wrong as well."""
PATH_SCALE_OFF: Final = 0.07
"""A smaller difference may come from the noise of velocities."""
SCALE_WITHIN: Final = (0.1, 10.0)
"""Beyond it the unit is wrong, which is another finding."""
VEHICLE_SCALE_OFF: Final = 0.04
"""Of VISO_SCALE: the vehicle's path is not known much better."""
SCALE_SIGMAS: Final = 4.0
"""Beyond so many sigmas of the estimate, the scale is no chance."""
FASTEST_M_S: Final = 60.0
"""A vehicle with a camera may be thought to fly so fast."""
HARDEST_M_S2: Final = 15.0
"""Half of the time, and over a second: no vehicle with a camera accelerates so hard for so long."""
COPTER_M_S: Final = 60.0
"""Times the root of the tangent of its lean: faster than racing copters, which reach 40 m/s at 45 deg."""
COPTER_WIND_M_S: Final = 5.0
"""A copter that does not lean moves no faster than a breeze, or the one who carries it."""
COPTER_TIMES_LEAN: Final = 3.0
"""Times gravity and the tangent of its lean, a copter does not accelerate half of the time."""
COPTER_GUSTS_M_S2: Final = 3.0
"""A copter that is carried accelerates without a lean."""
GRAVITY_M_S2: Final = 9.81
STEEPEST_LEAN: Final = 0.2
"""The cosine of a lean that counts; beyond it a tangent says nothing."""
FOOT: Final = 1 / 0.3048
"""Of a metre."""
FOOT_OFF: Final = 0.06
"""Of the factor: a scale is known no better."""
GLITCH_M_S: Final = 2.0
"""No vehicle changes its velocity by as much from one message to the next, and back."""
SPIKE_TIMES: Final = 10.0
"""Times the usual departure from the neighbours' mean."""
SPIKE_SIDES_SHARE: Final = 0.5
"""Of a spike: its neighbours differ by less, or the velocity really changed."""
STRETCH_TIMES: Final = 6.0
"""Times the usual difference of velocity and path."""
STRETCH_ELSEWHERE_M_S: Final = 0.5
"""Usually velocity and path differ by less, so that they fit elsewhere."""
FEWEST_IN_STRETCH: Final = 3
"""Windows: fewer may be a jump of the position."""
STRETCH_SHARE: Final = 0.5
"""Of the windows: a velocity that is wrong in more of them has another finding."""
DRIFT_WITHIN_M_S: Final = (0.1, 2.0)
"""Slower drifts are usual in an odometry; faster ones are no drift."""
DRIFT_TIMES_SPREAD: Final = 2.0
"""Times its own spread: a drift is steady."""
COARSE_STEP_M: Final = 0.03
"""Steps of positions that show beside the noise of a camera."""
TOO_COARSE_STEP_M: Final = 0.1
"""Half of the usual noise floor, VISO_POS_M_NSE 0.2 m."""

# XN6: resets and quality.

JUMP_M: Final = 0.5
"""A smaller jump passes the gate of the filter, or is noise."""
JUMP_TIMES_USUAL: Final = 8.0
"""Times the usual departure from the expected path."""
JUMP_WITHIN_S: Final = 2.0
"""Over longer gaps the allowed departure does not grow."""
JUMP_TURN_WITHIN_S: Final = 0.5
"""The same for yaw."""
JUMP_ACCELERATION_M_S2: Final = 20.0
"""A vehicle may leave the expected path by as much acceleration."""
POSES_APART_M: Final = 0.5
"""Two poses of one vehicle that lie closer together may differ by their noise."""
JUMP_TURN_RAD_S2: Final = 17.0
"""A vehicle, or a hand, may turn by as much acceleration."""
JUMP_RAD: Final = math.radians(10)
"""A smaller jump of yaw passes the gate of the filter, or is noise."""
LEVEL_PITCH_RAD: Final = math.radians(60)
"""In a steeper pitch a small rotation may change yaw by much."""
JUMP_SPEED_M_S: Final = 20.0
"""The motion before a jump is carried on with this speed at most: a jump itself is no motion."""
SHAKEN_TIMES: Final = 3.0
"""Times the turns around: while a camera is shaken, larger turns are no jumps."""
NO_JUMP_M: Final = 0.05
"""Below it the pose went on: a re-localisation moves it further."""
NO_JUMP_TIMES_USUAL: Final = 3.0
"""Times the usual departure, if that is more."""
NO_JUMP_RAD: Final = math.radians(2)
"""Below it the yaw went on."""
NO_JUMP_WITHIN_S: Final = 1.0
"""After a longer gap nobody knows whether the pose went on."""
COUNTER_NEIGHBOURS: Final = 2
"""Messages: a counter that changes so close to a jump belongs to it."""
FEWEST_FLAPS: Final = 5
"""Changes of a counter: fewer may be re-localisations."""
FLAPS_HZ: Final = 0.5
"""No camera re-localises more often."""
ALIGNED_WITHIN_US: Final = 100_000
"""A jump so close to the text of an alignment is the autopilot's own."""
FAILED_SHARE: Final = 0.1
"""Of the messages: a camera that fails more rarely finds its track again."""

# XN7: parameters.

FLAT_MOVED_M: Final = 0.3
"""A z that never changes while x and y change by more is not measured."""
FEWEST_GPS_INPUTS: Final = 20
"""Fewer GPS_INPUT may be those of a start."""

# XN8: alignment, and motion against the vehicle's.

YAW_FAR_OFF_RAD: Final = math.radians(20)
"""Positions are off by a third of their distance then."""
ALIGNED_FOR_US: Final = 1_000_000
"""The yaw of this time after an alignment is what was agreed on."""
LASTING_US: Final = 1_000_000
"""What disagrees for no longer may be one late message, or a quick turn."""
RELATED_CORRELATION: Final = 0.8
"""The least correlation of moves that belong together."""
UNLIKE_SHARE: Final = 0.3
"""The share of moves that may be off by more than half."""
HEADING_OFF_RAD: Final = math.radians(10)
"""As the autopilot itself compares yaw before arming."""
HEADING_LATE_S: Final = 0.5
"""In a turn, a message as late as the corrector allows is off by the turn of this time."""
HEADING_OFF_SHARE: Final = 0.05
"""Of the messages: fewer are a short disturbance of one of the two."""
FARTHEST_M: Final = 1e9
"""Positions beyond it are no numbers to compute with."""
NONSENSE_M_S: Final = 1e5
"""Velocities beyond it are no numbers to compute with."""
FEWEST_COMPARED: Final = 40
"""Of fewer messages the likeness of two paths is not known."""
SUMMED_GAP_S: Final = 0.5
"""Velocities are not summed over longer gaps."""
SHORTEST_COMPARED_US: Final = 3_000_000
"""In a shorter time a heading does not leave another one by much."""
YAW_SET_RAD: Final = math.radians(12)
"""More within YAW_SET_WITHIN_US is no turn: the vehicle's own yaw was set."""
YAW_SET_WITHIN_US: Final = 300_000
"""See YAW_SET_RAD; over longer gaps of telemetry a vehicle turns as far."""
TURNING_AROUND_US: Final = 500_000
"""The rate of turn is taken over this time before and after a message."""
YAW_OFF_MEDIAN_DEG: Final = 10.0
"""If half of the messages are off by more, the heading is lost."""
YAW_OFF_WORST_DEG: Final = 30.0
"""Beyond it a vehicle that holds its position circles."""
STILL_RATIO: Final = 0.2
"""Of the vehicle's path: a stream of unrelated moves that goes less far stands still."""
NO_SCALE_RATIO: Final = 0.05
"""The same of related moves: so small a scale is none that VISO_SCALE is for."""
MOSTLY_UNLIKE_SHARE: Final = 0.5
"""Of the moves: if more are off by half, the two motions have nothing to do with each other."""
WANDERS_TIMES: Final = 5.0
"""Times the reference's own noise and motion: a stream that moves more moves alone."""
LEAST_DEPARTURE_M: Final = 1.0
"""Below it a drift of some minutes, or a barometer's, is usual."""
STANDING_M_S: Final = 0.3
"""Of a vehicle that stands: the noise of velocities sums up to less."""
HEIGHT_OFF_TIMES: Final = 3.0
"""Times the noise of the reference's height."""
HEIGHT_OFF_PATH_SHARE: Final = 0.1
"""Of the path over the ground: an odometry may drift by as much, or the ground may slope."""
HEIGHT_OFF_CLIMB_SHARE: Final = 0.5
"""Of the climb: less is a matter of scale, and for XN5-18."""
HEIGHT_GAP_S: Final = 2.5
"""The reference's height is not interpolated over longer gaps; telemetry may come every 2 s."""
TWO_MOTIONS_WINDOW_S: Final = 2.0
"""Velocities are compared with the path over this time: shorter ones show noise and delay."""
OFF_BY_HALF: Final = 0.5
"""Of the speed: two velocities that differ by more are unlike."""
JUMP_TIMES_MEDIAN: Final = 4.0
"""Times the median speed: what is faster is a jump, and counts for nothing."""

# XN9: the filter.

FILTER_READY_US: Final = 8_000_000
"""Since boot: the model's filter may not have begun to navigate before."""
REJECTED_SHARE: Final = 0.05
"""Of the tested samples: a filter that rejects fewer is content."""
FEWEST_REJECTED: Final = 5
"""Fewer rejected or lost samples are single outliers."""
LOST_SAMPLES_SHARE: Final = 0.2
"""Of the samples: the filter does not miss one in five."""
BLIND_GAP_US: Final = 500_000
"""Over a longer gap the model's vehicle, which has no inertial data of its own, is guessed."""
EPISODE_US: Final = 2_000_000
"""Rejections closer together have one cause."""
ACCELERATION_OVER_S: Final = 0.2
"""Accelerations are taken over this time: shorter ones show the noise of positions."""
HARD_M_S2: Final = 5.0
"""The model's vehicle cannot follow a harder acceleration."""
IMPOSSIBLE_M_S2: Final = 30.0
"""A harder one is a jump."""
HARD_BEFORE_US: Final = 3_000_000
"""What the model's vehicle could not follow shows in its rejections for so long."""
HARD_AFTER_US: Final = 500_000
"""How long after its first sample a rejection may still come from the motion."""
MODEL_STOP_NEAR_US: Final = 10_000_000
"""The vehicle's own filter is looked at for so long after a stop of the model's: it is no clock."""
RATIO_LONG_S: Final = 5.0
"""A test ratio above 1 without a break for longer: the filter is about to time out."""
RATIO_MUCH_SHARE: Final = 0.1
"""Of the time in use, or of the messages of SYS_STATUS: that is no exception any more."""
RATIO_LASTING_S: Final = 2.0
"""In all: a share of a short recording may be one sample."""
RATIO_SHORT_S: Final = 1.0
"""A shorter excursion is a note: FS_EKF acts after a second."""
RATIO_SOME_SHARE: Final = 0.05
"""Of the time in use: a smaller share is a note."""
LOST_POSITION_S: Final = 0.5
"""Without a position for less, records may only have come at another moment."""
UNHEALTHY_SHARE: Final = 0.5
"""Of SYS_STATUS since the sensor was healthy: then it is no exception."""
WAITED_S: Final = 10.0
"""A filter that has waited for less may only have started."""
FEWEST_STOPS: Final = 3
"""So many stops of aiding are a fault of their own."""
FEWEST_STATUSES: Final = 3
"""Of fewer SYS_STATUS the first may be from before the first message."""

# XNF: optical flow.

FEWEST_FLOW: Final = 20
"""Fewer measurements show nothing."""
FLOW_BAD_SHARE: Final = 0.05
"""Of the measurements: any sensor misses some."""
FLOW_VERY_BAD_SHARE: Final = 0.3
"""Of the measurements: then the filter cannot hold a position."""
FLOW_SCALE_OFF: Final = 0.2
"""Smaller errors of scale are within what ranges and lenses do."""
FLOW_SCALE_FAR_OFF: Final = 0.4
"""Then the velocity is wrong by nearly half; without a range, uneven ground may do less."""
FLOW_TURNED_DEG: Final = 15.0
"""Less is how exactly a sensor is mounted."""
FLOW_LATE_MS: Final = 60.0
"""Smaller errors of EK3_FLOW_DELAY leave less of the rotation than noise does."""
FLOW_VERY_LATE_MS: Final = 150.0
"""Then flow and gyro are out of step in quick motion."""
FLOW_FROZEN_US: Final = 3_000_000
"""The same flow for less may be chance, in whole numbers."""
FLOW_MOVES_RAD_S: Final = 0.05
"""The vehicle turns by more, so that flow has to change."""
FLOW_COARSE_S: Final = 0.05
"""Of a period: with FLOW_TYPE 5 a step of flow is as many rad/s as the period has seconds; this shows."""
FLOW_VERY_COARSE_S: Final = 0.1
"""A step is as large as a usual flow then."""
FLYING_M: Final = 0.5
"""Above the start or the ground: whatever is higher flies."""

# XNR: range finders.

RANGE_STUCK_US: Final = 3_000_000
"""The same range for less may be a hover, in whole centimetres."""
FEWEST_RANGES: Final = 20
"""Fewer ranges show nothing."""
RANGE_STUCK_CLIMB_M: Final = 1.0
"""A barometer wanders by less in some seconds."""
RANGE_CLIMB_M: Final = 1.5
"""In a smaller climb the barometer's noise hides the scale."""
RANGE_ALIKE_CORRELATION: Final = 0.97
"""Over uneven ground ranges and heights are less alike, and show no scale."""
RANGE_SCALE_OFF: Final = 0.3
"""A slope of the ground does as much."""
OUTLIER_M: Final = 0.5
"""Grass and stones are smaller."""
OUTLIER_SHARE: Final = 0.2
"""Of the range: high up a tilt changes it by some of that."""
OUTLIERS_SHARE: Final = 0.01
"""Of the good ranges: single outliers are lost in the filter's median of three."""
FEWEST_OUTLIERS: Final = 3
"""One or two outliers are an echo."""
RANGE_LATE_US: Final = 150_000
"""In a climb of 1 m/s a shorter time is some centimetres, as the noise of heights."""
RANGE_LATE_UNEXPLAINED: Final = 0.4
"""Of what the height does not explain, another time has to leave less."""

# The vehicle's own estimate

ORIGIN_NEAR_US: Final = 2_000_000
"""Poses this long before the origin tell the height at which it was set."""

ORIGIN_HEIGHT_M: Final = 0.2
"""A smaller height, such as that of a camera above the ground, doubles unnoticed."""

ORIGIN_FAR_M: Final = 0.5
"""From this height on the error is more than a vehicle's own size."""

FEWEST_FIXES: Final = 10
"""Two seconds of a GPS at 5 Hz."""

GPS_COARSE_M: Final = 0.5
"""Accuracies below this are as good as those of external navigation."""

MOVE_FAR_M: Final = 1.0
"""A step that pulls a vehicle out of its place."""

MOVE_DEG_OF_M: Final = 20.0
"""As many degrees of a step of the yaw count as a metre of a step of the position."""

MOVE_AFTER_US: Final = 600_000
"""What moves an estimate happened this long before, at most."""

MOVE_SAID_US: Final = 300_000
"""A text about a move comes this long after it, at most."""

FEWEST_DELTAS: Final = 20
"""Two seconds of a DVL at 10 Hz."""

DELTA_MOVES_M_S: Final = 0.2
"""A vehicle that is faster does not stand."""

DELTA_OVER_US: Final = 1_000_000
"""Over this time the vehicle's speed is measured by its places."""

ZERO_DELTAS_SHARE: Final = 0.3
"""A sensor that measures reports exact zeros less often."""
