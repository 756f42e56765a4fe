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
    """A gust that all vehicles meet at once: from nothing to its greatest and back, (1 - cos) / 2."""

    at_s: NotNegative
    """When it begins, s from the start of the rehearsal."""

    for_s: Positive
    """How long it lasts, s."""

    north_m_s: Coordinate = 0.0
    """Greatest, toward north, m/s."""

    east_m_s: Coordinate = 0.0
    """Greatest, toward east, m/s."""


class Air(Section):
    """Gusts, turbulence and wind shear in addition to the mean wind; docs/emulator.md explains them."""

    turbulence: Literal["none", "light", "moderate", "severe"] = "none"
    """Dryden turbulence by MIL-F-8785C at low altitude, W20 of 15, 30 or 45 knots. Neighbours share it."""

    gusts: tuple[Gust, ...] = ()
    """Gusts that come and go."""

    roughness_m: Annotated[Positive, Field(le=0.5)] | None = None
    """Roughness of the ground, m: the wind grows with the logarithm of the height; if absent it does not."""


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
    """Where the air moves to (not where it comes from), degrees clockwise from north."""


Wind = Annotated[CalmWind | ArticleWind | SteadyWind, Field(discriminator="type")]


class LeaderStart(Section):
    """Where the leader is when the rehearsal begins."""

    north_m: Coordinate
    """Metres north of the origin."""

    east_m: Coordinate
    """Metres east of the origin."""

    course_deg: Course | None = None
    """Course at the start, degrees; along the beginning of the path if absent."""

    up_m: Annotated[Number, Field(ge=-9000.0, le=9000.0)] = 0.0
    """Above the mission's flying height, m; negative is below."""

    climb_m_s: Annotated[Number, Field(ge=-30.0, le=30.0)] = 0.0
    """Climb rate at which all begin in virtual time, m/s; emulators of `--live` begin level."""


class FollowerStart(Section):
    """How far from its slot a follower is when the rehearsal begins."""

    forward_m: Coordinate = 0.0
    """Ahead of its slot, along the leader's course at the start, m; negative is behind."""

    right_m: Coordinate = 0.0
    """Right of its slot, m; negative is left."""

    course_deg: Course | None = None
    """Course at the start, degrees; the leader's if absent."""

    up_m: Annotated[Number, Field(ge=-9000.0, le=9000.0)] = 0.0
    """Above its slot, m; negative is below."""


class Start(Section):
    """Where everyone begins: `leader`, and each follower by the name of its vehicle."""

    model_config = ConfigDict(extra="allow")

    __pydantic_extra__: dict[str, FollowerStart] = Field(init=False)

    leader: LeaderStart | None = None
    """Where the leader begins; 30 m right of the beginning of the path if absent."""

    @property
    def followers(self) -> dict[str, FollowerStart]:
        """Given starts of followers, by vehicle name."""
        return dict(self.__pydantic_extra__)


class EmulatedAircraft(Section):
    """What an emulated aircraft really is, apart from what its companion is told: see docs/emulator.md."""

    autopilot: Annotated[str, AfterValidator(known_in(emulated_autopilots))] | None = None
    """What really answers; if absent, the autopilot that each vehicle's own `autopilot` is for. Another one
    than `ardupilot` and `px4` is one of your own (`--plugin`)."""

    plant: Annotated[str, AfterValidator(known_in(plants))] | None = None
    """What really flies; if absent, what each vehicle's own `plant` says. `bank`: bank from course error,
    as ArduPlane does it; `npfg`: lateral acceleration from it, as PX4 does; `six-dof`: a rigid body with
    the Aerosonde's coefficients under attitude and energy loops, which flies 16 to 32 m/s; or one of one's
    own (`--plugin`)."""

    plant_options: dict[str, Number] = Field(default_factory=dict)
    """Numbers of a plant of one's own, by their names."""

    alpha_1_s: Annotated[Gain, Field(le=20.0)] | None = None
    """All plants but `bank` and `six-dof`: real bandwidth of the course (or heading) hold, 1/s; if absent
    what `vehicles` declares, as with all numbers down to `height_delay_s`."""

    beta_1_s: Annotated[Gain, Field(le=20.0)] | None = None
    """`speed_response: first-order`: real bandwidth of the speed hold, 1/s."""

    airspeed_range_m_s: AirspeedRange | None = None
    """Lowest and highest airspeed that it really flies, m/s."""

    max_bank_deg: Annotated[Number, Field(ge=1.0, le=80.0)] | None = None
    """Bank that it really reaches, degrees."""

    max_acceleration_m_s2: Annotated[Number, Field(ge=0.01, le=50.0)] | None = None
    """Fastest real change of speed, either way, m/s²."""

    climb_range_m_s: ClimbRange | None = None
    """Fastest real descent, negative, and climb, m/s."""

    height_delay_s: Annotated[Duration, Field(gt=0.0, le=20.0)] | None = None
    """By how much its height really lags behind a setpoint that climbs steadily, s."""

    guided_p: Annotated[Positive, Field(le=1e6)] = 12_000.0
    """`bank`, `six-dof`: bank for each course error, 0.01 degrees for 1 rad (ArduPlane's GUIDED_P)."""

    roll_time_s: Annotated[Positive, Field(le=10.0)] = 0.4
    """`bank`, `npfg`: time constant of the roll, s."""

    roll_delay_s: Annotated[NotNegative, Field(le=10.0)] = 0.0
    """`bank`, `npfg`: time constant with which the bank that is wanted reaches the roll, s."""

    turn_efficiency: Annotated[Positive, Field(le=2.0)] = 1.0
    """`bank`: turn rate in parts of the coordinated turn's; 0.7 was measured on ArduPlane."""

    speed_response: Literal["first-order", "tecs", "px4", "px4-untrimmed"] = "first-order"
    """`tecs`: an airspeed hold with an integral, limited acceleration and dead time, as in ArduPlane; `px4`:
    one whose setpoint slews with 1 m/s² and which swings, as PX4's with a throttle that is trimmed;
    `px4-untrimmed`: as PX4's comes, which goes 0.6 of the way and creeps on."""

    course_dead_time_s: Annotated[NotNegative, Field(le=10.0)] = 0.0
    """From a new course to the moment at which the autopilot's loop knows it, s."""

    speed_dead_time_s: Annotated[NotNegative, Field(le=10.0)] | None = None
    """From a new speed to the moment at which the loop knows it, s; if absent 0, or 0.5 with `tecs`."""

    indicated_airspeed: bool = False
    """Whether airspeeds on the wire are indicated ones, lower than the true ones by the air's density."""

    airspeed_calibration: Annotated[Number, Field(ge=0.5, le=2.0)] = 1.0
    """What airspeed sensors show in parts of what they should."""

    loop_rate_hz: Annotated[Number, Field(ge=10.0, le=1000.0)] | None = None
    """Rate of the scheduler on whose ticks telemetry leaves, Hz; if absent it leaves exactly on time."""


class Emulator(EmulatedAircraft):
    """What the emulated autopilots do that their companions are not told; docs/emulator.md explains it."""

    vehicles: dict[VehicleName, EmulatedAircraft] = Field(default_factory=dict)
    """Single vehicles by name, where they differ from the others: `{f1: {alpha_1_s: 0.4}}`."""

    def of(self, name: str) -> EmulatedAircraft:
        """Return the true aircraft of a vehicle: its own fields override the common ones."""
        common = self.model_dump(exclude_unset=True, exclude={"vehicles"})
        own = self.vehicles.get(name, EmulatedAircraft()).model_dump(exclude_unset=True)
        return EmulatedAircraft.model_validate(common | own)


class LeaderTelemetry(Section):
    """How an emulated leader without a companion is heard."""

    message: Literal[
        "GLOBAL_POSITION_INT",
        "FOLLOW_TARGET",
        "GLOBAL_POSITION_INT_COV",
        "HIGH_LATENCY2",
        "ADSB_VEHICLE",
    ] = "GLOBAL_POSITION_INT"
    """By which message."""

    rate_hz: Annotated[Number, Field(ge=0.1, le=50.0)] = 4.0
    """How often it is sent."""

    delay_s: Annotated[Duration, Field(le=5.0)] = 0.2
    """How long each message takes, s."""

    jitter_s: Annotated[Duration, Field(le=5.0)] = 0.0
    """More or less than that by up to this, s; at most `delay_s`."""

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
    """States per second of the leader."""

    followers_hz: Annotated[Number, Field(ge=0.1, le=50.0)] = 2.5
    """States per second of each follower."""

    baud: Annotated[WholeNumber, Field(ge=1200, le=12_000_000)] = 57_600
    """Rate of the serial lines to the radios, bits per second."""

    air_bytes_s: Annotated[Number, Field(ge=10.0, le=1e6)] = 4000.0
    """What all radios together can send, bytes per second."""

    loss: Annotated[NotNegative, Field(lt=1.0)] = 0.0
    """Share of the packets that a receiver misses outside bursts, 0 to below 1."""

    bursts: Annotated[NotNegative, Field(lt=1.0)] = 0.0
    """Share of the time in which a receiver hears nothing, in bursts of a second on average, 0 to below 1."""


class Loss(Section):
    """What a vehicle loses in the rehearsal, for a while or for good."""

    vehicle: VehicleName
    """Whose it is."""

    at_s: NotNegative
    """When, s from the start of the rehearsal."""

    for_s: Positive | None = None
    """For how long, s; for good if absent."""

    what: Literal["companion", "link", "guidance"] = "companion"
    """`companion`: the program ends without a word, and one that knows nothing takes its place; `link`: the
    vehicle hears no other and is heard by none; `guidance`: its pilot takes it, into a loiter, and gives it
    back."""

    def lasts(self, now: float) -> bool:
        """Check whether the loss lasts at a time, s from the start of the rehearsal."""
        return self.at_s <= now < self.at_s + (math.inf if self.for_s is None else self.for_s)


class Rehearsal(Section):
    """The flight on the computer."""

    duration_s: Annotated[Number, Field(ge=1.0, le=86400.0)] = 300.0
    """How long it lasts, s."""

    rate_hz: Annotated[Number, Field(ge=2.0, le=100.0)] = 20.0
    """Position reports per second, and with them guidance steps."""

    start: Start = Start()
    """Where everyone begins."""

    emulator: Emulator = Emulator()
    """What the emulated autopilots do that their companions are not told."""

    leader_telemetry: LeaderTelemetry = LeaderTelemetry()
    """How a leader without a companion is heard (`leader.follows`)."""

    losses: tuple[Loss, ...] = ()
    """What vehicles lose on the way."""

    radio: Radio | None = None
    """The link is a shared radio; if absent each state takes `link_delay_s`."""

    link_delay_s: Duration = 0.1
    """Time a leader state takes to arrive, s."""

    link_jitter_s: Duration = 0.0
    """Each leader state takes `link_delay_s` plus or minus up to this, evenly spread, s."""

    link_loss: Annotated[NotNegative, Field(lt=1.0)] = 0.0
    """Share of leader states that never arrive, 0 to below 1."""

    sensors: Literal["ideal", "rtk", "sbas", "standalone"] = "ideal"
    """GNSS receivers of this grade, and airspeed sensors, barometers and clocks like real ones."""

    position_noise_m: Annotated[NotNegative, Field(le=1000.0)] = 0.0
    """Standard deviation of the noise on each position report, m."""

    seed: Annotated[WholeNumber, Field(ge=0, le=2**32 - 1)] = 1
    """Seed of everything random: the same seed gives the same flight."""


class Acceptance(Section):
    """What the flight must reach; whatever is absent is not asked for."""

    mean_error_m: Positive | None = None
    """Highest mean formation error over the second half of the flight, m."""

    max_error_m: Positive | None = None
    """Highest formation error over the second half of the flight, m."""

    mean_error_3d_m: Positive | None = None
    """Highest mean formation error in space, heights included, over the second half of the flight, m."""

    settle_10m_s: Positive | None = None
    """Time after which every follower stays within 10 m of its slot, s."""

    settle_1m_s: Positive | None = None
    """Time after which every follower stays within 1 m of its slot, s."""

    min_separation_m: NotNegative = 5.0
    """Least distance between any two vehicles, at any time, m."""
