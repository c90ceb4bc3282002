# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The MAVLink messages that the endpoint and the companion know, as frozen dataclasses.

Field names, units and order are those of the message definitions (common.xml, ardupilotmega.xml). Arrays are tuples,
text is ``str`` without its padding. Extension fields, which a sender may leave out, default to zero as on the wire.
"""

from dataclasses import dataclass


class Message:
    """Base of all messages; the class name is MAVLink's name of the message."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class HEARTBEAT(Message):
    """Presence, type, mode and state of a component."""

    type: int
    autopilot: int
    base_mode: int
    custom_mode: int
    system_status: int
    mavlink_version: int


@dataclass(frozen=True, slots=True)
class SYS_STATUS(Message):
    """Sensors present, enabled and healthy (bit masks), load, battery and error counters."""

    onboard_control_sensors_present: int
    onboard_control_sensors_enabled: int
    onboard_control_sensors_health: int
    load: int
    voltage_battery: int
    current_battery: int
    battery_remaining: int
    drop_rate_comm: int
    errors_comm: int
    errors_count1: int
    errors_count2: int
    errors_count3: int
    errors_count4: int
    onboard_control_sensors_present_extended: int = 0
    onboard_control_sensors_enabled_extended: int = 0
    onboard_control_sensors_health_extended: int = 0


@dataclass(frozen=True, slots=True)
class SYSTEM_TIME(Message):
    """UTC in us (0 while unknown) and ms since boot."""

    time_unix_usec: int
    time_boot_ms: int


@dataclass(frozen=True, slots=True)
class SET_MODE(Message):
    """Request for a flight mode."""

    target_system: int
    base_mode: int
    custom_mode: int


@dataclass(frozen=True, slots=True)
class PARAM_REQUEST_READ(Message):
    """Request for one parameter, by index or (index -1) by name."""

    target_system: int
    target_component: int
    param_id: str
    param_index: int


@dataclass(frozen=True, slots=True)
class PARAM_REQUEST_LIST(Message):
    """Request for all parameters."""

    target_system: int
    target_component: int


@dataclass(frozen=True, slots=True)
class PARAM_VALUE(Message):
    """One parameter: value as float32 whatever its type."""

    param_id: str
    param_value: float
    param_type: int
    param_count: int
    param_index: int


@dataclass(frozen=True, slots=True)
class PARAM_SET(Message):
    """Request to change a parameter."""

    target_system: int
    target_component: int
    param_id: str
    param_value: float
    param_type: int


@dataclass(frozen=True, slots=True)
class ATTITUDE(Message):
    """Roll, pitch, yaw in rad, body rates in rad/s."""

    time_boot_ms: int
    roll: float
    pitch: float
    yaw: float
    rollspeed: float
    pitchspeed: float
    yawspeed: float


@dataclass(frozen=True, slots=True)
class LOCAL_POSITION_NED(Message):
    """Position in m and velocity in m/s, NED from the EKF origin."""

    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


@dataclass(frozen=True, slots=True)
class SET_GPS_GLOBAL_ORIGIN(Message):
    """Request to set the EKF origin: degE7, mm above mean sea level."""

    target_system: int
    latitude: int
    longitude: int
    altitude: int
    time_usec: int = 0


@dataclass(frozen=True, slots=True)
class GPS_GLOBAL_ORIGIN(Message):
    """The EKF origin: degE7, mm above mean sea level, us since boot."""

    latitude: int
    longitude: int
    altitude: int
    time_usec: int = 0


@dataclass(frozen=True, slots=True)
class REQUEST_DATA_STREAM(Message):
    """Request for the rate in Hz of a group of messages."""

    target_system: int
    target_component: int
    req_stream_id: int
    req_message_rate: int
    start_stop: int


@dataclass(frozen=True, slots=True)
class COMMAND_INT(Message):
    """A command with x and y as integers."""

    target_system: int
    target_component: int
    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float


@dataclass(frozen=True, slots=True)
class COMMAND_LONG(Message):
    """A command with seven float32 parameters."""

    target_system: int
    target_component: int
    command: int
    confirmation: int
    param1: float
    param2: float
    param3: float
    param4: float
    param5: float
    param6: float
    param7: float


@dataclass(frozen=True, slots=True)
class COMMAND_ACK(Message):
    """Result of a command."""

    command: int
    result: int
    progress: int = 0
    result_param2: int = 0
    target_system: int = 0
    target_component: int = 0


@dataclass(frozen=True, slots=True)
class GLOBAL_VISION_POSITION_ESTIMATE(Message):
    """An alias of VISION_POSITION_ESTIMATE to the firmware; not a geodetic position."""

    usec: int
    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    covariance: tuple[float, ...] = (0.0,) * 21
    reset_counter: int = 0


@dataclass(frozen=True, slots=True)
class VISION_POSITION_ESTIMATE(Message):
    """Position in m NED, roll, pitch, yaw in rad, row-major upper triangle of the 6x6 covariance."""

    usec: int
    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    covariance: tuple[float, ...] = (0.0,) * 21
    reset_counter: int = 0


@dataclass(frozen=True, slots=True)
class VISION_SPEED_ESTIMATE(Message):
    """Velocity in m/s NED, 3x3 covariance."""

    usec: int
    x: float
    y: float
    z: float
    covariance: tuple[float, ...] = (0.0,) * 9
    reset_counter: int = 0


@dataclass(frozen=True, slots=True)
class VICON_POSITION_ESTIMATE(Message):
    """As VISION_POSITION_ESTIMATE, without a reset counter."""

    usec: int
    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    covariance: tuple[float, ...] = (0.0,) * 21


@dataclass(frozen=True, slots=True)
class TIMESYNC(Message):
    """Time in ns: tc1 of the answering side (0 in a request), ts1 of the asking side."""

    tc1: int
    ts1: int


@dataclass(frozen=True, slots=True)
class ATT_POS_MOCAP(Message):
    """Attitude as w, x, y, z and position in m NED."""

    time_usec: int
    q: tuple[float, ...]
    x: float
    y: float
    z: float
    covariance: tuple[float, ...] = (0.0,) * 21


@dataclass(frozen=True, slots=True)
class AUTOPILOT_VERSION_REQUEST(Message):
    """Request for AUTOPILOT_VERSION."""

    target_system: int
    target_component: int


@dataclass(frozen=True, slots=True)
class AUTOPILOT_VERSION(Message):
    """Capabilities, versions and ids."""

    capabilities: int
    flight_sw_version: int
    middleware_sw_version: int
    os_sw_version: int
    board_version: int
    flight_custom_version: tuple[int, ...]
    middleware_custom_version: tuple[int, ...]
    os_custom_version: tuple[int, ...]
    vendor_id: int
    product_id: int
    uid: int
    uid2: tuple[int, ...] = (0,) * 18


@dataclass(frozen=True, slots=True)
class HOME_POSITION(Message):
    """Home: degE7, mm; m NED from the EKF origin."""

    latitude: int
    longitude: int
    altitude: int
    x: float
    y: float
    z: float
    q: tuple[float, ...]
    approach_x: float
    approach_y: float
    approach_z: float
    time_usec: int = 0


@dataclass(frozen=True, slots=True)
class MESSAGE_INTERVAL(Message):
    """Interval of a message in us: -1 not sent, 0 unknown."""

    message_id: int
    interval_us: int


@dataclass(frozen=True, slots=True)
class NAMED_VALUE_FLOAT(Message):
    """A value with a name, for debugging."""

    time_boot_ms: int
    name: str
    value: float


@dataclass(frozen=True, slots=True)
class STATUSTEXT(Message):
    """A text with its severity; longer ones come in chunks of 50 characters that share an id."""

    severity: int
    text: str
    id: int = 0
    chunk_seq: int = 0


@dataclass(frozen=True, slots=True)
class ODOMETRY(Message):
    """Pose and velocity: m, m/s, rad/s; q as w, x, y, z; quality -1 failed, 0 unknown, 1..100."""

    time_usec: int
    frame_id: int
    child_frame_id: int
    x: float
    y: float
    z: float
    q: tuple[float, ...]
    vx: float
    vy: float
    vz: float
    rollspeed: float
    pitchspeed: float
    yawspeed: float
    pose_covariance: tuple[float, ...]
    velocity_covariance: tuple[float, ...]
    reset_counter: int = 0
    estimator_type: int = 0
    quality: int = 0


@dataclass(frozen=True, slots=True)
class VISION_POSITION_DELTA(Message):
    """Change of angle (rad) and position (m) in the body frame over time_delta_usec."""

    time_usec: int
    time_delta_usec: int
    angle_delta: tuple[float, ...]
    position_delta: tuple[float, ...]
    confidence: float


@dataclass(frozen=True, slots=True)
class FILE_TRANSFER_PROTOCOL(Message):
    """One request or reply of MAVLink FTP, 251 bytes."""

    target_network: int
    target_system: int
    target_component: int
    payload: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class LOG_REQUEST_LIST(Message):
    """Request for a list of logs: first and last id."""

    target_system: int
    target_component: int
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class LOG_ENTRY(Message):
    """One log: id 1..num_logs, last id of this list, UTC in s (0 while unknown), bytes; all 0 when there is none."""

    id: int
    num_logs: int
    last_log_num: int
    time_utc: int
    size: int


@dataclass(frozen=True, slots=True)
class LOG_REQUEST_DATA(Message):
    """Request for ``count`` bytes of a log from offset ``ofs`` on."""

    target_system: int
    target_component: int
    id: int
    ofs: int
    count: int


@dataclass(frozen=True, slots=True)
class LOG_DATA(Message):
    """Up to 90 bytes of a log, padded with zeros; fewer end the transfer."""

    id: int
    ofs: int
    count: int
    data: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class LOG_ERASE(Message):
    """Request to erase all logs."""

    target_system: int
    target_component: int


@dataclass(frozen=True, slots=True)
class LOG_REQUEST_END(Message):
    """Request to stop a log transfer."""

    target_system: int
    target_component: int


@dataclass(frozen=True, slots=True)
class SETUP_SIGNING(Message):
    """Signing key of 32 bytes and first timestamp (10 us since 2015); all zero ends signing."""

    target_system: int
    target_component: int
    secret_key: tuple[int, ...]
    initial_timestamp: int


@dataclass(frozen=True, slots=True)
class RADIO_STATUS(Message):
    """Signal and noise of a radio and its peer, free transmit buffer (%), receive errors and corrected packets."""

    rssi: int
    remrssi: int
    txbuf: int
    noise: int
    remnoise: int
    rxerrors: int
    fixed: int
