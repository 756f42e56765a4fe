"""Rehearsal of a mission on the computer, and its acceptance limits."""

import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, ConfigDict, Field, model_validator

from vfguide.mission.finding import Misfit, refuse
from vfguide.mission.quantity import (
    Coordinate,
    Course,
    Duration,
    Gain,
    NotNegative,
    Number,
    Positive,
    Section,
    VehicleName,
    WholeNumber,
    known_in,
)
from vfguide.mission.vehicle import AirspeedRange, ClimbRange
from vfguide.registry import emulated_autopilots, plants


class Gust(Section):
    """A (1 - cos) / 2 gust, which meets all vehicles at once."""

    at_s: NotNegative
    """Beginning, s from the start of the rehearsal."""

    for_s: Positive
    """Duration, s."""

    north_m_s: Coordinate = 0.0
    """Maximum speed toward north, m/s."""

    east_m_s: Coordinate = 0.0
    """Maximum speed toward east, m/s."""


class Air(Section):
    """Gusts, turbulence and wind shear in addition to the mean wind; docs/emulator.md explains them."""

    turbulence: Literal["none", "light", "moderate", "severe"] = "none"
    """Dryden turbulence by MIL-F-8785C at low altitude: W20 of 15, 30 or 45 knots. Neighbours share it."""

    gusts: tuple[Gust, ...] = ()
    """Discrete gusts."""

    roughness_m: Annotated[Positive, Field(le=0.5)] | None = None
    """Roughness length of the ground, m: wind grows with the logarithm of the height; uniform if absent."""


class CalmWind(Air):
    """No wind."""

    type: Literal["calm"]
    """`calm`."""


class ArticleWind(Air):
    """The article's wind: 5 + 3 cos(0.1 t) m/s, blowing toward 135° + 180° sin(0.1 t)."""

    type: Literal["article"]
    """`article`."""


class SteadyWind(Air):
    """A constant wind, the same everywhere."""

    type: Literal["steady"]
    """`steady`."""

    speed_m_s: Annotated[NotNegative, Field(le=100.0)]
    """Wind speed, m/s."""

    toward_deg: Course
    """Direction in which the air moves (not where it comes from), degrees clockwise from north."""


Wind = Annotated[CalmWind | ArticleWind | SteadyWind, Field(discriminator="type")]


class LeaderStart(Section):
    """Start of the leader."""

    north_m: Coordinate
    """Metres north of the origin."""

    east_m: Coordinate
    """Metres east of the origin."""

    course_deg: Course | None = None
    """Course at the start, degrees; along the beginning of the path if absent."""

    up_m: Annotated[Number, Field(ge=-9000.0, le=9000.0)] = 0.0
    """Above the mission's flying height, m; negative is below."""

    climb_m_s: Annotated[Number, Field(ge=-30.0, le=30.0)] = 0.0
    """Initial climb rate of all vehicles in virtual time, m/s; emulators of `--live` begin level."""


class FollowerStart(Section):
    """Start of a follower, relative to its slot."""

    forward_m: Coordinate = 0.0
    """Distance ahead of its slot, along the leader's course at the start, m; negative is behind."""

    right_m: Coordinate = 0.0
    """Distance right of its slot, m; negative is left."""

    course_deg: Course | None = None
    """Course at the start, degrees; the leader's if absent."""

    up_m: Annotated[Number, Field(ge=-9000.0, le=9000.0)] = 0.0
    """Height above its slot, m; negative is below."""


class Start(Section):
    """Starts of the vehicles: `leader`, and each follower by vehicle name."""

    model_config = ConfigDict(extra="allow")

    __pydantic_extra__: dict[str, FollowerStart] = Field(init=False)

    leader: LeaderStart | None = None
    """Start of the leader; 30 m right of the beginning of the path if absent."""

    @property
    def followers(self) -> dict[str, FollowerStart]:
        """Given starts of followers, by vehicle name."""
        return dict(self.__pydantic_extra__)


class EmulatedAircraft(Section):
    """True properties of an emulated aircraft, of which its companion is not told; see docs/emulator.md."""

    autopilot: Annotated[str, AfterValidator(known_in(emulated_autopilots))] | None = None
    """Emulated autopilot; by default the one of each vehicle's `autopilot`. Besides `ardupilot` and `px4` it
    may be a user-defined one (`--plugin`)."""

    plant: Annotated[str, AfterValidator(known_in(plants))] | None = None
    """Emulated plant; by default each vehicle's `plant`. `bank`: bank from course error, as in ArduPlane;
    `npfg`: lateral acceleration from course error, as in PX4; `six-dof`: a rigid body with the Aerosonde's
    coefficients under attitude and energy loops, for 16 to 32 m/s; or a user-defined one (`--plugin`)."""

    plant_options: dict[str, Number] = Field(default_factory=dict)
    """Options of a user-defined plant, by name."""

    alpha_1_s: Annotated[Gain, Field(le=20.0)] | None = None
    """True bandwidth of the course (or heading) hold, 1/s, of all plants but `bank` and `six-dof`. This and
    all numbers down to `height_delay_s` default to the values under `vehicles`."""

    beta_1_s: Annotated[Gain, Field(le=20.0)] | None = None
    """`speed_response: first-order`: true bandwidth of the speed hold, 1/s."""

    airspeed_range_m_s: AirspeedRange | None = None
    """True minimum and maximum airspeed, m/s."""

    max_bank_deg: Annotated[Number, Field(ge=1.0, le=80.0)] | None = None
    """True maximum bank, degrees."""

    max_acceleration_m_s2: Annotated[Number, Field(ge=0.01, le=50.0)] | None = None
    """True maximum acceleration, either way, m/s²."""

    climb_range_m_s: ClimbRange | None = None
    """True maximum descent rate, negative, and climb rate, m/s."""

    height_delay_s: Annotated[Duration, Field(gt=0.0, le=20.0)] | None = None
    """True lag of the height behind a setpoint that climbs steadily, s."""

    guided_p: Annotated[Positive, Field(le=1e6)] = 12_000.0
    """`bank`, `six-dof`: bank per course error, 0.01 degrees per rad (ArduPlane's GUIDED_P)."""

    roll_time_s: Annotated[Positive, Field(le=10.0)] = 0.4
    """`bank`, `npfg`: time constant of the roll, s."""

    roll_delay_s: Annotated[NotNegative, Field(le=10.0)] = 0.0
    """`bank`, `npfg`: time constant from the commanded bank to the roll, s."""

    turn_efficiency: Annotated[Positive, Field(le=2.0)] = 1.0
    """`bank`: turn rate as a fraction of the coordinated turn's; 0.7 was measured on ArduPlane."""

    speed_response: Literal["first-order", "tecs", "px4", "px4-untrimmed"] = "first-order"
    """`tecs`: an airspeed hold with an integral, limited acceleration and dead time, as in ArduPlane. `px4`:
    a hold that oscillates, with a setpoint slewing at 1 m/s², like PX4's with a trimmed throttle.
    `px4-untrimmed`: like PX4's default, which reaches 0.6 of the step and then creeps."""

    course_dead_time_s: Annotated[NotNegative, Field(le=10.0)] = 0.0
    """Dead time from a new course to its arrival in the autopilot's loop, s."""

    speed_dead_time_s: Annotated[NotNegative, Field(le=10.0)] | None = None
    """Dead time from a new speed to its arrival in the autopilot's loop, s; by default 0, or 0.5 with
    `tecs`."""

    indicated_airspeed: bool = False
    """Whether airspeeds on the wire are indicated ones, which air density makes lower than the true ones."""

    airspeed_calibration: Annotated[Number, Field(ge=0.5, le=2.0)] = 1.0
    """Ratio of the airspeed sensors' reading to the right one."""

    loop_rate_hz: Annotated[Number, Field(ge=10.0, le=1000.0)] | None = None
    """Rate of the scheduler on whose ticks telemetry leaves, Hz; if absent it leaves exactly on time."""


class Emulator(EmulatedAircraft):
    """True properties of the emulated aircraft, unknown to their companions; see docs/emulator.md."""

    vehicles: dict[VehicleName, EmulatedAircraft] = Field(default_factory=dict)
    """Properties of single vehicles by name, where they differ: `{f1: {alpha_1_s: 0.4}}`."""

    def of(self, name: str) -> EmulatedAircraft:
        """Return the true aircraft of a vehicle: its own fields override the common ones."""
        common = self.model_dump(exclude_unset=True, exclude={"vehicles"})
        own = self.vehicles.get(name, EmulatedAircraft()).model_dump(exclude_unset=True)
        return EmulatedAircraft.model_validate(common | own)


class LeaderTelemetry(Section):
    """Telemetry of an emulated leader without a companion."""

    message: Literal[
        "GLOBAL_POSITION_INT",
        "FOLLOW_TARGET",
        "GLOBAL_POSITION_INT_COV",
        "HIGH_LATENCY2",
        "ADSB_VEHICLE",
    ] = "GLOBAL_POSITION_INT"
    """Message with the leader's position."""

    rate_hz: Annotated[Number, Field(ge=0.1, le=50.0)] = 4.0
    """Rate of the message, Hz."""

    delay_s: Annotated[Duration, Field(le=5.0)] = 0.2
    """Latency of each message, s."""

    jitter_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """Jitter of the latency, plus or minus, s; at most `delay_s`."""

    loss: Annotated[NotNegative, Field(lt=1.0)] = 0.0
    """Share of messages that never arrive, 0 to below 1."""

    @model_validator(mode="after")
    def _arrives_after_it_is_sent(self) -> Self:
        if self.jitter_s > self.delay_s:
            message = f"more than delay_s, {self.delay_s:g} s"
            refuse([Misfit(("jitter_s",), message, "lower it, or raise delay_s")], self)
        return self


class Radio(Section):
    """A telemetry radio that the whole formation shares, in virtual time; docs/link.md explains it."""

    leader_hz: Annotated[Number, Field(ge=0.1, le=50.0)] = 10.0
    """Leader states per second."""

    followers_hz: Annotated[Number, Field(ge=0.1, le=50.0)] = 2.5
    """States per second of each follower."""

    baud: Annotated[WholeNumber, Field(ge=1200, le=12_000_000)] = 57_600
    """Rate of the serial lines to the radios, bits per second."""

    air_bytes_s: Annotated[Number, Field(ge=10.0, le=1e6)] = 4000.0
    """Capacity of the radio channel, bytes per second."""

    loss: Annotated[NotNegative, Field(lt=1.0)] = 0.0
    """Share of packets that a receiver misses outside bursts, 0 to below 1."""

    bursts: Annotated[NotNegative, Field(lt=1.0)] = 0.0
    """Share of time in which a receiver hears nothing, in bursts of one second on average, 0 to below 1."""


class Loss(Section):
    """A temporary or permanent loss of a vehicle in the rehearsal."""

    vehicle: VehicleName
    """Affected vehicle."""

    at_s: NotNegative
    """Time of the loss, s from the start of the rehearsal."""

    for_s: Positive | None = None
    """Duration, s; permanent if absent."""

    what: Literal["companion", "link", "guidance"] = "companion"
    """`companion`: the program ends abruptly, and a new one without its memory replaces it. `link`: the
    vehicle neither receives nor is received. `guidance`: its pilot takes over, loiters, and gives the
    vehicle back."""

    def lasts(self, now: float) -> bool:
        """Check whether the loss lasts at a time, s from the start of the rehearsal."""
        return self.at_s <= now < self.at_s + (math.inf if self.for_s is None else self.for_s)


class Rehearsal(Section):
    """Rehearsal of the flight on the computer."""

    duration_s: Annotated[Number, Field(ge=1.0, le=86400.0)] = 300.0
    """Duration, s."""

    rate_hz: Annotated[Number, Field(ge=2.0, le=100.0)] = 20.0
    """Position reports and guidance steps per second."""

    start: Start = Start()
    """Starts of the vehicles."""

    emulator: Emulator = Emulator()
    """True properties of the emulated aircraft."""

    leader_telemetry: LeaderTelemetry = LeaderTelemetry()
    """Telemetry of a leader without a companion (`leader.follows`)."""

    losses: tuple[Loss, ...] = ()
    """Losses during the rehearsal."""

    radio: Radio | None = None
    """Shared radio as the link; if absent each state takes `link_delay_s`."""

    link_delay_s: Duration = 0.1
    """Latency of a leader state, s."""

    link_jitter_s: Duration = 0.0
    """Jitter of the latency, plus or minus, uniformly distributed, s."""

    link_loss: Annotated[NotNegative, Field(lt=1.0)] = 0.0
    """Share of leader states that never arrive, 0 to below 1."""

    sensors: Literal["ideal", "rtk", "sbas", "standalone"] = "ideal"
    """Sensor quality: GNSS receivers of this grade, with realistic airspeed sensors, barometers and clocks.
    """

    position_noise_m: Annotated[NotNegative, Field(le=1000.0)] = 0.0
    """Standard deviation of the noise on each position report, m."""

    seed: Annotated[WholeNumber, Field(ge=0, le=2**32 - 1)] = 1
    """Seed of all random processes: the same seed gives the same flight."""


class Acceptance(Section):
    """Acceptance limits of the flight; absent limits do not apply."""

    mean_error_m: Positive | None = None
    """Maximum mean formation error over the second half of the flight, m."""

    max_error_m: Positive | None = None
    """Maximum formation error over the second half of the flight, m."""

    mean_error_3d_m: Positive | None = None
    """Maximum mean formation error in space, heights included, over the second half of the flight, m."""

    settle_10m_s: Positive | None = None
    """Time after which every follower stays within 10 m of its slot, s."""

    settle_1m_s: Positive | None = None
    """Time after which every follower stays within 1 m of its slot, s."""

    min_separation_m: NotNegative = 5.0
    """Minimum distance between any two vehicles, at any time, m."""
