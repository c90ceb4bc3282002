# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The MAVLink messages that the endpoint and the companion know, as frozen dataclasses.

tools/make_messages.py writes this file. Field names and order are those of the message definitions (common.xml,
ardupilotmega.xml). Arrays are tuples, text is ``str`` without its padding. Extension fields, which a sender may leave
out, are zero by default, as on the wire.
"""

from collections.abc import Mapping
from dataclasses import Field, dataclass
from typing import Any, ClassVar, Final


class Message:
    """Base of all messages, which are dataclasses; the class name is MAVLink's name of the message."""

    __slots__ = ()

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


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
class PARAM_ERROR(Message):
    """Why a parameter was not read or set (MAV_PARAM_ERROR); by name with index -1."""

    target_system: int
    target_component: int
    param_id: str
    param_index: int
    error: int


@dataclass(frozen=True, slots=True)
class GPS_RAW_INT(Message):
    """What a GPS says: degE7, mm, dilutions x 100 (65535 unknown), cm/s, centidegrees; accuracies in mm and mm/s."""

    time_usec: int
    fix_type: int
    lat: int
    lon: int
    alt: int
    eph: int
    epv: int
    vel: int
    cog: int
    satellites_visible: int
    alt_ellipsoid: int = 0
    h_acc: int = 0
    v_acc: int = 0
    vel_acc: int = 0
    hdg_acc: int = 0
    yaw: int = 0


@dataclass(frozen=True, slots=True)
class GPS2_RAW(Message):
    """The same of the second GPS, with satellites and age (ms) of corrections."""

    time_usec: int
    fix_type: int
    lat: int
    lon: int
    alt: int
    eph: int
    epv: int
    vel: int
    cog: int
    satellites_visible: int
    dgps_numch: int
    dgps_age: int
    yaw: int = 0
    alt_ellipsoid: int = 0
    h_acc: int = 0
    v_acc: int = 0
    vel_acc: int = 0
    hdg_acc: int = 0


@dataclass(frozen=True, slots=True)
class SCALED_IMU(Message):
    """First IMU and compass: mG, mrad/s, mgauss, 0.01 degC."""

    time_boot_ms: int
    xacc: int
    yacc: int
    zacc: int
    xgyro: int
    ygyro: int
    zgyro: int
    xmag: int
    ymag: int
    zmag: int
    temperature: int = 0


@dataclass(frozen=True, slots=True)
class RAW_IMU(Message):
    """First IMU and compass, as the firmware scales them: mG, mrad/s, mgauss, 0.01 degC."""

    time_usec: int
    xacc: int
    yacc: int
    zacc: int
    xgyro: int
    ygyro: int
    zgyro: int
    xmag: int
    ymag: int
    zmag: int
    id: int = 0
    temperature: int = 0


@dataclass(frozen=True, slots=True)
class SCALED_PRESSURE(Message):
    """First barometer: hPa, 0.01 degC."""

    time_boot_ms: int
    press_abs: float
    press_diff: float
    temperature: int
    temperature_press_diff: int = 0


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
class ATTITUDE_QUATERNION(Message):
    """Attitude as w, x, y, z (body to NED), body rates in rad/s."""

    time_boot_ms: int
    q1: float
    q2: float
    q3: float
    q4: float
    rollspeed: float
    pitchspeed: float
    yawspeed: float
    repr_offset_q: tuple[float, ...] = (0.0,) * 4


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
class GLOBAL_POSITION_INT(Message):
    """Place and velocity: degE7, mm above sea level and above home, cm/s NED, centidegrees."""

    time_boot_ms: int
    lat: int
    lon: int
    alt: int
    relative_alt: int
    vx: int
    vy: int
    vz: int
    hdg: int


@dataclass(frozen=True, slots=True)
class RC_CHANNELS_RAW(Message):
    """Eight radio channels in us, for MAVLink 1."""

    time_boot_ms: int
    port: int
    chan1_raw: int
    chan2_raw: int
    chan3_raw: int
    chan4_raw: int
    chan5_raw: int
    chan6_raw: int
    chan7_raw: int
    chan8_raw: int
    rssi: int


@dataclass(frozen=True, slots=True)
class SERVO_OUTPUT_RAW(Message):
    """Sixteen servo outputs in us."""

    time_usec: int
    port: int
    servo1_raw: int
    servo2_raw: int
    servo3_raw: int
    servo4_raw: int
    servo5_raw: int
    servo6_raw: int
    servo7_raw: int
    servo8_raw: int
    servo9_raw: int = 0
    servo10_raw: int = 0
    servo11_raw: int = 0
    servo12_raw: int = 0
    servo13_raw: int = 0
    servo14_raw: int = 0
    servo15_raw: int = 0
    servo16_raw: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_CURRENT(Message):
    """The mission's present item, number of items, state and mode."""

    seq: int
    total: int = 0
    mission_state: int = 0
    mission_mode: int = 0


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
class NAV_CONTROLLER_OUTPUT(Message):
    """Where the controllers want to go: degrees, m, m/s."""

    nav_roll: float
    nav_pitch: float
    nav_bearing: int
    target_bearing: int
    wp_dist: int
    alt_error: float
    aspd_error: float
    xtrack_error: float


@dataclass(frozen=True, slots=True)
class RC_CHANNELS(Message):
    """Eighteen radio channels in us, signal strength (255 unknown)."""

    time_boot_ms: int
    chancount: int
    chan1_raw: int
    chan2_raw: int
    chan3_raw: int
    chan4_raw: int
    chan5_raw: int
    chan6_raw: int
    chan7_raw: int
    chan8_raw: int
    chan9_raw: int
    chan10_raw: int
    chan11_raw: int
    chan12_raw: int
    chan13_raw: int
    chan14_raw: int
    chan15_raw: int
    chan16_raw: int
    chan17_raw: int
    chan18_raw: int
    rssi: int


@dataclass(frozen=True, slots=True)
class REQUEST_DATA_STREAM(Message):
    """Request for the rate in Hz of a group of messages."""

    target_system: int
    target_component: int
    req_stream_id: int
    req_message_rate: int
    start_stop: int


@dataclass(frozen=True, slots=True)
class VFR_HUD(Message):
    """What a pilot looks at: m/s, degrees, percent, m above sea level, m/s upwards."""

    airspeed: float
    groundspeed: float
    heading: int
    throttle: int
    alt: float
    climb: float


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
class HIGHRES_IMU(Message):
    """Inertial sensors, compass and barometer with a mask of what is new: m/s/s, rad/s, hPa, m, degC."""

    time_usec: int
    xacc: float
    yacc: float
    zacc: float
    xgyro: float
    ygyro: float
    zgyro: float
    xmag: float
    ymag: float
    zmag: float
    abs_pressure: float
    diff_pressure: float
    pressure_alt: float
    temperature: float
    fields_updated: int
    id: int = 0


@dataclass(frozen=True, slots=True)
class SIM_STATE(Message):
    """A simulator's truth: attitude in rad, m/s/s, rad/s, degrees of place, m of altitude, m/s NED, 1e-7 degrees."""

    q1: float
    q2: float
    q3: float
    q4: float
    roll: float
    pitch: float
    yaw: float
    xacc: float
    yacc: float
    zacc: float
    xgyro: float
    ygyro: float
    zgyro: float
    lat: float
    lon: float
    alt: float
    std_dev_horz: float
    std_dev_vert: float
    vn: float
    ve: float
    vd: float
    lat_int: int = 0
    lon_int: int = 0


@dataclass(frozen=True, slots=True)
class TIMESYNC(Message):
    """Time in ns: tc1 of the answering side (0 in a request), ts1 of the asking side."""

    tc1: int
    ts1: int


@dataclass(frozen=True, slots=True)
class SCALED_IMU2(Message):
    """Second IMU and compass, as SCALED_IMU."""

    time_boot_ms: int
    xacc: int
    yacc: int
    zacc: int
    xgyro: int
    ygyro: int
    zgyro: int
    xmag: int
    ymag: int
    zmag: int
    temperature: int = 0


@dataclass(frozen=True, slots=True)
class POWER_STATUS(Message):
    """Voltages of the board and of the servo rail in mV."""

    Vcc: int
    Vservo: int
    flags: int


@dataclass(frozen=True, slots=True)
class SCALED_IMU3(Message):
    """Third IMU and compass, as SCALED_IMU."""

    time_boot_ms: int
    xacc: int
    yacc: int
    zacc: int
    xgyro: int
    ygyro: int
    zgyro: int
    xmag: int
    ymag: int
    zmag: int
    temperature: int = 0


@dataclass(frozen=True, slots=True)
class SCALED_PRESSURE2(Message):
    """Second barometer, as SCALED_PRESSURE."""

    time_boot_ms: int
    press_abs: float
    press_diff: float
    temperature: int
    temperature_press_diff: int = 0


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
class BATTERY_STATUS(Message):
    """A battery: mV of each cell (65535 none), cA, mAh, hJ, percent."""

    id: int
    battery_function: int
    type: int
    temperature: int
    voltages: tuple[int, ...]
    current_battery: int
    current_consumed: int
    energy_consumed: int
    battery_remaining: int
    time_remaining: int = 0
    charge_state: int = 0
    voltages_ext: tuple[int, ...] = (0,) * 4
    mode: int = 0
    fault_bitmask: int = 0


@dataclass(frozen=True, slots=True)
class MEMINFO(Message):
    """Free memory in bytes."""

    brkval: int
    freemem: int
    freemem32: int = 0


@dataclass(frozen=True, slots=True)
class AHRS(Message):
    """Gyro bias in rad/s and DCM's errors."""

    omegaIx: float
    omegaIy: float
    omegaIz: float
    accel_weight: float
    renorm_val: float
    error_rp: float
    error_yaw: float


@dataclass(frozen=True, slots=True)
class SIMSTATE(Message):
    """ArduPilot's simulator's truth: attitude in rad, m/s/s, rad/s, place in 1e-7 degrees."""

    roll: float
    pitch: float
    yaw: float
    xacc: float
    yacc: float
    zacc: float
    xgyro: float
    ygyro: float
    zgyro: float
    lat: int
    lng: int


@dataclass(frozen=True, slots=True)
class HWSTATUS(Message):
    """Voltage of the board in mV, errors of the I2C bus."""

    Vcc: int
    I2Cerr: int


@dataclass(frozen=True, slots=True)
class AHRS2(Message):
    """Attitude in rad and place (m, degE7) of the second estimator."""

    roll: float
    pitch: float
    yaw: float
    altitude: float
    lat: int
    lng: int


@dataclass(frozen=True, slots=True)
class SET_POSITION_TARGET_LOCAL_NED(Message):
    """Where to fly: m, m/s, m/s/s NED, rad, rad/s; the mask says what to ignore."""

    time_boot_ms: int
    target_system: int
    target_component: int
    coordinate_frame: int
    type_mask: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    afx: float
    afy: float
    afz: float
    yaw: float
    yaw_rate: float


@dataclass(frozen=True, slots=True)
class SET_POSITION_TARGET_GLOBAL_INT(Message):
    """Where to fly: degE7 and m, m/s, m/s/s NED, rad, rad/s; the mask says what to ignore."""

    time_boot_ms: int
    target_system: int
    target_component: int
    coordinate_frame: int
    type_mask: int
    lat_int: int
    lon_int: int
    alt: float
    vx: float
    vy: float
    vz: float
    afx: float
    afy: float
    afz: float
    yaw: float
    yaw_rate: float


@dataclass(frozen=True, slots=True)
class RC_CHANNELS_OVERRIDE(Message):
    """Pulse lengths in us in place of the radio's; 65535 is none, and 0 gives a channel back to the radio."""

    target_system: int
    target_component: int
    chan1_raw: int
    chan2_raw: int
    chan3_raw: int
    chan4_raw: int
    chan5_raw: int
    chan6_raw: int
    chan7_raw: int
    chan8_raw: int
    chan9_raw: int = 0
    chan10_raw: int = 0
    chan11_raw: int = 0
    chan12_raw: int = 0
    chan13_raw: int = 0
    chan14_raw: int = 0
    chan15_raw: int = 0
    chan16_raw: int = 0
    chan17_raw: int = 0
    chan18_raw: int = 0


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
class EKF_STATUS_REPORT(Message):
    """What the EKF says of itself: flags, and square roots of test ratios, 1.0 at the gate."""

    flags: int
    velocity_variance: float
    pos_horiz_variance: float
    pos_vert_variance: float
    compass_variance: float
    terrain_alt_variance: float
    airspeed_variance: float = 0.0


@dataclass(frozen=True, slots=True)
class VIBRATION(Message):
    """Vibration levels in m/s/s and how often each accelerometer clipped."""

    time_usec: int
    vibration_x: float
    vibration_y: float
    vibration_z: float
    clipping_0: int
    clipping_1: int
    clipping_2: int


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
class EXTENDED_SYS_STATE(Message):
    """Kind of flight of a VTOL, and whether landed."""

    vtol_state: int
    landed_state: int


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


@dataclass(frozen=True, slots=True)
class OPTICAL_FLOW(Message):
    """Movement of an image: flow in 0.1 pixels (as the sender sees it), compensated flow in m/s, quality 0..255."""

    time_usec: int
    sensor_id: int
    flow_x: int
    flow_y: int
    flow_comp_m_x: float
    flow_comp_m_y: float
    quality: int
    ground_distance: float
    flow_rate_x: float = 0.0
    flow_rate_y: float = 0.0


@dataclass(frozen=True, slots=True)
class DISTANCE_SENSOR(Message):
    """A distance in cm, its limits, and where the sensor looks."""

    time_boot_ms: int
    min_distance: int
    max_distance: int
    current_distance: int
    type: int
    id: int
    orientation: int
    covariance: int
    horizontal_fov: float = 0.0
    vertical_fov: float = 0.0
    quaternion: tuple[float, ...] = (0.0,) * 4
    signal_quality: int = 0


@dataclass(frozen=True, slots=True)
class RANGEFINDER(Message):
    """The range of a range finder that looks down, m, and its voltage."""

    distance: float
    voltage: float


@dataclass(frozen=True, slots=True)
class LANDING_TARGET(Message):
    """Where a landing target is: angles in rad from the image's middle, distance in m, or a position in m."""

    time_usec: int
    target_num: int
    frame: int
    angle_x: float
    angle_y: float
    distance: float
    size_x: float
    size_y: float
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    q: tuple[float, ...] = (0.0,) * 4
    type: int = 0
    position_valid: int = 0


@dataclass(frozen=True, slots=True)
class GPS_INPUT(Message):
    """A GPS solution: degE7, m above mean sea level, m/s NED, accuracies in m/s and m; yaw in 0.01 deg, 0 for none."""

    time_usec: int
    gps_id: int
    ignore_flags: int
    time_week_ms: int
    time_week: int
    fix_type: int
    lat: int
    lon: int
    alt: float
    hdop: float
    vdop: float
    vn: float
    ve: float
    vd: float
    speed_accuracy: float
    horiz_accuracy: float
    vert_accuracy: float
    satellites_visible: int
    yaw: int = 0


@dataclass(frozen=True, slots=True)
class HIL_SENSOR(Message):
    """A simulator's sensors with a mask of what is new: m/s/s (gravity felt), rad/s, gauss, hPa, m, degC."""

    time_usec: int
    xacc: float
    yacc: float
    zacc: float
    xgyro: float
    ygyro: float
    zgyro: float
    xmag: float
    ymag: float
    zmag: float
    abs_pressure: float
    diff_pressure: float
    pressure_alt: float
    temperature: float
    fields_updated: int
    id: int = 0


@dataclass(frozen=True, slots=True)
class HIL_STATE_QUATERNION(Message):
    """A simulator's truth: w, x, y, z (body to NED), rad/s, degE7, mm, cm/s NED, airspeeds in cm/s, mG."""

    time_usec: int
    attitude_quaternion: tuple[float, ...]
    rollspeed: float
    pitchspeed: float
    yawspeed: float
    lat: int
    lon: int
    alt: int
    vx: int
    vy: int
    vz: int
    ind_airspeed: int
    true_airspeed: int
    xacc: int
    yacc: int
    zacc: int


@dataclass(frozen=True, slots=True)
class ADSB_VEHICLE(Message):
    """An aircraft: degE7, mm, heading in 0.01 deg, speeds in cm/s, seconds since it was last heard of."""

    ICAO_address: int
    lat: int
    lon: int
    altitude_type: int
    altitude: int
    heading: int
    hor_velocity: int
    ver_velocity: int
    callsign: str
    emitter_type: int
    tslc: int
    flags: int
    squawk: int


@dataclass(frozen=True, slots=True)
class RADIO(Message):
    """RADIO_STATUS as older radios send it."""

    rssi: int
    remrssi: int
    txbuf: int
    noise: int
    remnoise: int
    rxerrors: int
    fixed: int


@dataclass(frozen=True, slots=True)
class AVAILABLE_MODES(Message):
    """One flight mode: how many there are, its index from 1, its numbers, its properties (bits) and its name."""

    number_modes: int
    mode_index: int
    standard_mode: int
    custom_mode: int
    properties: int
    mode_name: str


@dataclass(frozen=True, slots=True)
class AVAILABLE_MODES_MONITOR(Message):
    """A number that changes with the list of modes."""

    seq: int


@dataclass(frozen=True, slots=True)
class MISSION_REQUEST_LIST(Message):
    """Request for the number of items: of a mission (0), a fence (1) or rally points (2)."""

    target_system: int
    target_component: int
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_COUNT(Message):
    """How many items there are, or will come."""

    target_system: int
    target_component: int
    count: int
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_REQUEST(Message):
    """Request for one item, in float32."""

    target_system: int
    target_component: int
    seq: int
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_REQUEST_INT(Message):
    """Request for one item."""

    target_system: int
    target_component: int
    seq: int
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_ITEM(Message):
    """One item; x and y are degrees where they are a place, z is metres."""

    target_system: int
    target_component: int
    seq: int
    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: float
    y: float
    z: float
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_ITEM_INT(Message):
    """One item; x and y are degE7 where they are a place, z is metres."""

    target_system: int
    target_component: int
    seq: int
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
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_ACK(Message):
    """End of a transfer, with a MAV_MISSION_RESULT."""

    target_system: int
    target_component: int
    type: int
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_CLEAR_ALL(Message):
    """Request to forget all items."""

    target_system: int
    target_component: int
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class MISSION_SET_CURRENT(Message):
    """Request to go on with an item."""

    target_system: int
    target_component: int
    seq: int


@dataclass(frozen=True, slots=True)
class MISSION_ITEM_REACHED(Message):
    """The item that was done last."""

    seq: int


@dataclass(frozen=True, slots=True)
class MISSION_WRITE_PARTIAL_LIST(Message):
    """Announcement of items that replace some."""

    target_system: int
    target_component: int
    start_index: int
    end_index: int
    mission_type: int = 0


@dataclass(frozen=True, slots=True)
class SET_HOME_POSITION(Message):
    """Wish for another home: degE7, mm; the firmware ignores it."""

    target_system: int
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


MESSAGES: Final[Mapping[str, type[Message]]] = {
    cls.__name__: cls
    for cls in (
        HEARTBEAT,
        SYS_STATUS,
        SYSTEM_TIME,
        SET_MODE,
        PARAM_REQUEST_READ,
        PARAM_REQUEST_LIST,
        PARAM_VALUE,
        PARAM_SET,
        PARAM_ERROR,
        GPS_RAW_INT,
        GPS2_RAW,
        SCALED_IMU,
        RAW_IMU,
        SCALED_PRESSURE,
        ATTITUDE,
        ATTITUDE_QUATERNION,
        LOCAL_POSITION_NED,
        GLOBAL_POSITION_INT,
        RC_CHANNELS_RAW,
        SERVO_OUTPUT_RAW,
        MISSION_CURRENT,
        SET_GPS_GLOBAL_ORIGIN,
        GPS_GLOBAL_ORIGIN,
        NAV_CONTROLLER_OUTPUT,
        RC_CHANNELS,
        REQUEST_DATA_STREAM,
        VFR_HUD,
        COMMAND_INT,
        COMMAND_LONG,
        COMMAND_ACK,
        GLOBAL_VISION_POSITION_ESTIMATE,
        VISION_POSITION_ESTIMATE,
        VISION_SPEED_ESTIMATE,
        VICON_POSITION_ESTIMATE,
        HIGHRES_IMU,
        SIM_STATE,
        TIMESYNC,
        SCALED_IMU2,
        POWER_STATUS,
        SCALED_IMU3,
        SCALED_PRESSURE2,
        ATT_POS_MOCAP,
        BATTERY_STATUS,
        MEMINFO,
        AHRS,
        SIMSTATE,
        HWSTATUS,
        AHRS2,
        SET_POSITION_TARGET_LOCAL_NED,
        SET_POSITION_TARGET_GLOBAL_INT,
        RC_CHANNELS_OVERRIDE,
        AUTOPILOT_VERSION_REQUEST,
        AUTOPILOT_VERSION,
        EKF_STATUS_REPORT,
        VIBRATION,
        HOME_POSITION,
        MESSAGE_INTERVAL,
        EXTENDED_SYS_STATE,
        NAMED_VALUE_FLOAT,
        STATUSTEXT,
        ODOMETRY,
        VISION_POSITION_DELTA,
        FILE_TRANSFER_PROTOCOL,
        LOG_REQUEST_LIST,
        LOG_ENTRY,
        LOG_REQUEST_DATA,
        LOG_DATA,
        LOG_ERASE,
        LOG_REQUEST_END,
        SETUP_SIGNING,
        RADIO_STATUS,
        OPTICAL_FLOW,
        DISTANCE_SENSOR,
        RANGEFINDER,
        LANDING_TARGET,
        GPS_INPUT,
        HIL_SENSOR,
        HIL_STATE_QUATERNION,
        ADSB_VEHICLE,
        RADIO,
        AVAILABLE_MODES,
        AVAILABLE_MODES_MONITOR,
        MISSION_REQUEST_LIST,
        MISSION_COUNT,
        MISSION_REQUEST,
        MISSION_REQUEST_INT,
        MISSION_ITEM,
        MISSION_ITEM_INT,
        MISSION_ACK,
        MISSION_CLEAR_ALL,
        MISSION_SET_CURRENT,
        MISSION_ITEM_REACHED,
        MISSION_WRITE_PARTIAL_LIST,
        SET_HOME_POSITION,
    )
}
"""All message classes by name."""
