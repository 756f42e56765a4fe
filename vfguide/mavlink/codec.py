"""Codec between MAVLink frames and reports in SI units; only here are degE7, cm/s and centidegrees known.

Reports of other aircraft (ADSB_VEHICLE) are checked for plausible numbers. A well-formed report need not be
true: whoever has a transmitter can send it.
"""

import math
import struct
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink, MAVLink_message

from vfguide.mavlink.framing import (
    STEERING_COMMANDS,
    STEERING_MESSAGES,
    ConnectionSigning,
    Frame,
    SequencePlaces,
    TextJoiner,
    frame_of,
    frames_of,
    message_in,
    steers,
)
from vfguide.mavlink.reports import (
    AirspeedReport,
    AttitudeReport,
    BatteryReport,
    CommandReport,
    EstimatorReport,
    GpsReport,
    HeartbeatReport,
    LandedReport,
    OrderRequest,
    ParameterReport,
    PositionReport,
    RadioReport,
    Report,
    SensorsReport,
    SteeringReport,
    TimeReport,
    TrafficReport,
    VersionReport,
)

LOWEST_M, HIGHEST_M = -1000.0, 30_000.0
"""Lowest and highest altitude of aircraft, m; any other counts as unknown."""

PRESSURE_ALTITUDE_ERROR_M = 500.0
"""Error of a pressure altitude, m: the QNH may be unset, and sea-level pressures lie within 60 hPa of the
standard, at 27 ft per hPa."""

GREATEST_M_S = 1000.0
"""Highest plausible speed, m/s."""

GREATEST_CLIMB_M_S = 30.0
"""Highest plausible climb or sink rate, m/s."""

LONG_SILENT_S = 5.0
"""Silence of an aircraft after which an ADS-B receiver's repetitions are ignored, s."""

ALTITUDE_ERRORS_M = {
    mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC: 0.0,
    mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH: PRESSURE_ALTITUDE_ERROR_M,
}
"""Errors of the known types of altitude, m; any other altitude counts as unknown."""

Pair = tuple[float, float]

UNKNOWN_HEADING = 65535
"""hdg of an autopilot that does not know its yaw (UINT16_MAX, as the message set defines it)."""

NO_MILLIVOLTS = 65535
"""voltage_battery of an autopilot that does not measure it (UINT16_MAX)."""

GREATEST_AIRSPEED = 500.0
"""Highest plausible airspeed of an aircraft guided here, m/s."""

GREATEST_BANK = math.radians(89.0)
"""Greatest plausible bank angle, rad: beyond it the bank does not determine the turn."""

WHOLE_NUMBERS = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<Bxxx",
    mavlink.MAV_PARAM_TYPE_INT8: "<bxxx",
    mavlink.MAV_PARAM_TYPE_UINT16: "<Hxx",
    mavlink.MAV_PARAM_TYPE_INT16: "<hxx",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}
"""Layouts of whole numbers in the four bytes of a parameter's value, where they are not converted."""

COMPANION_COMPONENT = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER

ECHOES = 256
"""Number of own steering messages remembered, to recognize those that a router sends back."""

OUR_COMPONENTS = frozenset({mavlink.MAV_COMP_ID_ALL, COMPANION_COMPONENT})
"""Target components within the own system that mean this companion."""


def altitude_of(metres: float) -> float:
    """Return a plausible altitude (m), otherwise NaN."""
    return metres if LOWEST_M <= metres <= HIGHEST_M else math.nan


def climb_of(down: float) -> float:
    """Return the climb rate of a downward velocity (m/s); 0 if it is implausible."""
    return -down if abs(down) <= GREATEST_CLIMB_M_S else 0.0


def pair_of(north: float, east: float, *, greatest: float) -> Pair | None:
    """Return a vector, or None if it is not finite or too long."""
    return (north, east) if math.hypot(north, east) <= greatest else None


def is_on_earth(latitude: int, longitude: int) -> bool:
    """Check whether these 1e-7 degrees are a place to fly: autopilots without a fix report 0, 0."""
    return abs(latitude) <= 90e7 and abs(longitude) <= 180e7 and (latitude, longitude) != (0, 0)


def traffic_report(message: MAVLink_message) -> TrafficReport | None:
    """Decode ADSB_VEHICLE: course (not heading) in centidegrees, cm/s, and seconds since it was heard."""
    flags = message.flags
    wanted = mavlink.ADSB_FLAGS_VALID_COORDS
    if flags & wanted != wanted or message.tslc > LONG_SILENT_S:
        return None
    if not is_on_earth(message.lat, message.lon):
        return None
    velocity = None
    if flags & mavlink.ADSB_FLAGS_VALID_HEADING and flags & mavlink.ADSB_FLAGS_VALID_VELOCITY:
        course, speed = math.radians(message.heading * 1e-2), message.hor_velocity * 1e-2
        velocity = speed * math.cos(course), speed * math.sin(course)
    error = ALTITUDE_ERRORS_M.get(message.altitude_type)
    known = error is not None and flags & mavlink.ADSB_FLAGS_VALID_ALTITUDE
    climbs = flags & mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID
    return TrafficReport(
        icao_address=message.ICAO_address,
        latitude_deg=message.lat * 1e-7,
        longitude_deg=message.lon * 1e-7,
        altitude_amsl=altitude_of(message.altitude * 1e-3) if known else math.nan,
        altitude_error=error or 0.0,
        velocity=velocity,
        # Unlike all other messages, this one counts it upward.
        climb_rate=climb_of(-message.ver_velocity * 1e-2) if climbs else 0.0,
        age_s=float(message.tslc),
    )


def position_report(message: MAVLink_message) -> PositionReport | None:
    """Decode GLOBAL_POSITION_INT; None if it is no place on earth."""
    latitude, longitude = message.lat * 1e-7, message.lon * 1e-7
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return None
    known = message.hdg != UNKNOWN_HEADING
    return PositionReport(
        boot_time_s=message.time_boot_ms * 1e-3,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl=message.alt * 1e-3,
        velocity_north=message.vx * 1e-2,
        velocity_east=message.vy * 1e-2,
        heading=math.radians(message.hdg * 1e-2) if known else None,
        climb_rate=-message.vz * 1e-2,
    )


def airspeed_report(message: MAVLink_message) -> AirspeedReport | None:
    """Decode VFR_HUD; None if the airspeed is implausible."""
    airspeed = message.airspeed
    if not 0.0 <= airspeed <= GREATEST_AIRSPEED:
        return None
    known = 0 <= message.heading <= 360
    return AirspeedReport(
        airspeed=airspeed, heading=math.radians(message.heading) if known else None
    )


def attitude_report(message: MAVLink_message) -> AttitudeReport | None:
    """Decode ATTITUDE; None if the roll is implausible for an aircraft in flight."""
    bank = message.roll
    return AttitudeReport(bank=bank) if abs(bank) <= GREATEST_BANK else None


def heartbeat_report(message: MAVLink_message) -> HeartbeatReport | None:
    """Decode HEARTBEAT; None if it is not an autopilot's."""
    if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
        return None
    return HeartbeatReport(
        autopilot=message.autopilot,
        custom_mode=message.custom_mode,
        armed=bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        vehicle_type=message.type,
        status=message.system_status,
    )


def landed_report(message: MAVLink_message) -> LandedReport:
    """Decode EXTENDED_SYS_STATE."""
    return LandedReport(state=message.landed_state)


def command_report(message: MAVLink_message) -> CommandReport:
    """Decode COMMAND_ACK."""
    return CommandReport(command=message.command, result=message.result)


def order_request(message: MAVLink_message) -> OrderRequest | None:
    """Decode COMMAND_LONG with MAV_CMD_USER_1; None for other commands and for values that are not finite."""
    values = message.param2, message.param3, message.param4
    known = all(map(math.isfinite, (message.param1, *values)))
    if message.command != mavlink.MAV_CMD_USER_1 or not known:
        return None
    return OrderRequest(
        sender=(message.get_srcSystem(), message.get_srcComponent()),
        code=message.param1,
        values=values,
        confirmation=message.confirmation,
    )


def answered_to(message: MAVLink_message) -> list[SteeringReport]:
    """Return the sender of a steering command that the autopilot accepts; empty for other messages."""
    if message.get_msgId() != mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
        return []
    if message.command not in STEERING_COMMANDS or message.result != mavlink.MAV_RESULT_ACCEPTED:
        return []
    return [SteeringReport(sender=(message.target_system, message.target_component))]


def version_report(message: MAVLink_message) -> VersionReport:
    """Decode AUTOPILOT_VERSION: major and minor are the two upper bytes of the firmware's version."""
    version = message.flight_sw_version
    uid = message.uid or int.from_bytes(bytes(message.uid2), "little")
    return VersionReport(major=version >> 24, minor=version >> 16 & 0xFF, uid=uid)


def parameter_report(message: MAVLink_message) -> ParameterReport | None:
    """Decode PARAM_VALUE; None if it is neither a finite nor a whole number."""
    layout = WHOLE_NUMBERS.get(message.param_type)
    value = float(message.param_value)
    if layout is None and not math.isfinite(value):
        return None
    name = "".join(character for character in message.param_id if character.isprintable())
    whole = None if layout is None else struct.unpack(layout, struct.pack("<f", value))[0]
    return ParameterReport(name=name, value=value, whole=whole)


def time_report(message: MAVLink_message) -> TimeReport | None:
    """Decode the answer of a TIMESYNC; None for a question."""
    if message.tc1 == 0:
        return None
    return TimeReport(stamp=message.ts1, autopilot_ns=message.tc1)


def gps_report(message: MAVLink_message) -> GpsReport:
    """Decode GPS_RAW_INT; an accuracy of 0 is unknown."""
    millimetres = message.h_acc
    return GpsReport(
        fix_type=message.fix_type,
        accuracy=millimetres * 1e-3 if millimetres else None,
        altitude_amsl=message.alt * 1e-3,
    )


def estimator_report(message: MAVLink_message) -> EstimatorReport:
    """Decode EKF_STATUS_REPORT or ESTIMATOR_STATUS, whose flags have the same values up to 512.

    The flag of a constant position means nothing. PX4 1.18 sets it for every aircraft at rest; ArduPilot
    clears the flag of the position with it.
    """
    flags = message.flags
    return EstimatorReport(
        has_position=bool(flags & mavlink.ESTIMATOR_POS_HORIZ_ABS),
        has_velocity=bool(flags & mavlink.ESTIMATOR_VELOCITY_HORIZ),
    )


def sensors_report(message: MAVLink_message) -> SensorsReport:
    """Decode SYS_STATUS; a voltage of 0 is unknown."""
    expected = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
    failing = expected & ~message.onboard_control_sensors_health
    percent, millivolts = message.battery_remaining, message.voltage_battery
    return SensorsReport(
        gps=not failing & mavlink.MAV_SYS_STATUS_SENSOR_GPS,
        attitude=not failing & mavlink.MAV_SYS_STATUS_AHRS,
        battery=percent * 1e-2 if 0 <= percent <= 100 else None,
        battery_voltage=millivolts * 1e-3 if 0 < millivolts < NO_MILLIVOLTS else None,
    )


def battery_report(message: MAVLink_message) -> BatteryReport:
    """Decode BATTERY_STATUS; the voltage excludes unmeasured cells, which are 0 among the later ones."""
    percent = message.battery_remaining
    cells = [one for one in message.voltages if one < NO_MILLIVOLTS]
    cells += [one for one in message.voltages_ext if 0 < one < NO_MILLIVOLTS]
    millivolts = sum(cells)
    return BatteryReport(
        number=message.id,
        remaining=percent * 1e-2 if 0 <= percent <= 100 else None,
        voltage=millivolts * 1e-3 if millivolts else None,
    )


def radio_report(message: MAVLink_message) -> RadioReport | None:
    """Decode RADIO_STATUS; None for a share above 100 %."""
    return RadioReport(free=message.txbuf / 100.0) if message.txbuf <= 100 else None


def not_read(_message: MAVLink_message) -> None:
    """Return nothing for a message that is joined with others."""


REPORTS: dict[int, Callable[[MAVLink_message], Report | None]] = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: position_report,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: airspeed_report,
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat_report,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: landed_report,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK: command_report,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT: not_read,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: version_report,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE: parameter_report,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: time_report,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: gps_report,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: estimator_report,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: estimator_report,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: sensors_report,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: battery_report,
    mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: traffic_report,
}
"""Decoders of the messages used; all others are ignored and counted."""

ATTITUDE_REPORTS: dict[int, Callable[[MAVLink_message], Report | None]] = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude_report
}
"""Decoders of further messages, used on request."""


class Codec:
    """Codec of one companion's connection: datagrams to reports, messages to bytes."""

    def __init__(
        self,
        system_id: int,
        component_id: int,
        *,
        signing: ConnectionSigning | None = None,
        takes_orders: bool = False,
        hears_attitude: bool = False,
    ) -> None:
        """Listen to one autopilot, and send as the onboard computer of the same system.

        Args:
            system_id: MAVLink system of the vehicle.
            component_id: component of its autopilot.
            signing: signs outgoing messages and lets only signed ones in; None ignores signatures.
            takes_orders: whether to hear requests for orders, from whoever addresses them to this companion.
            hears_attitude: whether to hear ATTITUDE, which autopilots send often and few flights need.
        """
        self.counters: Counter[str] = Counter()
        """Numbers of frames that were received and ignored, by reason."""
        self._source = (system_id, component_id)
        self.places = SequencePlaces()
        """Sequence numbers of the autopilot's frames, which tell two autopilots of the same name apart."""
        self._texts = TextJoiner()
        self._sent: deque[bytes] = deque(maxlen=ECHOES)
        self._signing = signing
        self._takes_orders = takes_orders
        self._readers = REPORTS | (ATTITUDE_REPORTS if hears_attitude else {})
        self._packer = MAVLink(None, srcSystem=system_id, srcComponent=COMPANION_COMPONENT)

    def decode(self, datagram: bytes) -> list[Report]:
        """Return the reports in a datagram; never raises, whatever the bytes are."""
        reports: list[Report] = []
        for frame in frames_of(datagram):
            if frame is None:
                self.counters["not MAVLink"] += 1
            elif (frame.system_id, frame.component_id) != self._source:
                reports += self._others(frame)
            elif frame.message_id not in self._readers:
                self._note_sender(frame)
                self.counters["not used"] += 1
                if frame.message_id in STEERING_MESSAGES:
                    reports += self._steering(frame)
            else:
                reports += self._read(frame)
        return reports

    def _read(self, frame: Frame) -> Sequence[Report]:
        """Return the reports in a frame of the autopilot."""
        message = message_in(frame)
        if message is None:
            self.counters["not MAVLink"] += 1
        elif self._signing is not None and not self._signing.accepts(frame):
            self.counters["not signed"] += 1
        elif not self._is_addressed(message):
            self._note_sender(frame)
            self.counters["for somebody else"] += 1
            return answered_to(message)
        elif frame.message_id == mavlink.MAVLINK_MSG_ID_STATUSTEXT:
            self._note_sender(frame)
            return self._texts.take(message)
        else:
            return self._reports_of(frame, message)
        return ()

    def _reports_of(self, frame: Frame, message: MAVLink_message) -> Sequence[Report]:
        """Return the reports in a message, with the series of its sequence number where that matters."""
        series = self._note_sender(frame)
        report = self._readers[frame.message_id](message)
        if report is None:
            self.counters["out of range"] += 1
            return ()
        if series and isinstance(report, PositionReport | HeartbeatReport):
            report = replace(report, series=series)
        if isinstance(report, HeartbeatReport):
            return (*self._texts.beat(), report)
        return (report,)

    def _note_sender(self, frame: Frame) -> int:
        """Return the series of a frame in the autopilot's name; 0 if unsigned on a signed connection."""
        if self._signing is not None and not self._signing.has_taken(frame):
            return 0
        return self.places.note(frame)

    def _steering(self, frame: Frame) -> list[SteeringReport]:
        """Return a report if a frame is somebody else's message that steers this vehicle."""
        message = message_in(frame)
        if message is None or frame.content in self._sent or not steers(message):
            return []
        if self._signing is not None and not self._signing.vouches_for(frame):
            return []
        system_id, component_id = message.target_system, message.target_component
        meant = system_id in {0, self._source[0]} and component_id in {0, self._source[1]}
        return [SteeringReport(sender=(frame.system_id, frame.component_id))] if meant else []

    def _others(self, frame: Frame) -> list[Report]:
        """Return the reports in others' frames: orders to this companion, steering, and radio status."""
        if frame.message_id in STEERING_MESSAGES and (found := self._steering(frame)):
            return [*found]
        if frame.message_id == mavlink.MAVLINK_MSG_ID_RADIO_STATUS:
            # Radios have names of their own and sign nothing: their reports can only slow this companion.
            said = message_in(frame)
            radio = None if said is None else radio_report(said)
            return [] if radio is None else [radio]
        wanted = self._takes_orders and frame.message_id == mavlink.MAVLINK_MSG_ID_COMMAND_LONG
        message = message_in(frame) if wanted else None
        target = (self._source[0], COMPANION_COMPONENT)
        if message is None or (message.target_system, message.target_component) != target:
            self.counters["not this vehicle's"] += 1
            return []
        if self._signing is not None and not self._signing.accepts(frame):
            self.counters["not signed"] += 1
            return []
        request = order_request(message)
        return [] if request is None else [request]

    def encode(self, messages: Iterable[MAVLink_message]) -> bytes:
        """Pack messages into one datagram."""
        if self._signing is not None:
            self._signing.prepare(self._packer)
        return b"".join([self._pack(message) for message in messages])

    def _is_addressed(self, message: MAVLink_message) -> bool:
        """Check whether a message is for this companion or, with target 0 or none, for all.

        An autopilot answers a ground station's commands within hearing of everyone.
        """
        system_id: int = getattr(message, "target_system", 0)
        if system_id == 0:
            return True
        return system_id == self._source[0] and message.target_component in OUR_COMPONENTS

    def _pack(self, message: MAVLink_message) -> bytes:
        packed = frame_of(message, self._packer)
        if message.get_msgId() in STEERING_MESSAGES:
            self._sent.append(packed)
        self._packer.seq = (self._packer.seq + 1) % 256
        return packed
