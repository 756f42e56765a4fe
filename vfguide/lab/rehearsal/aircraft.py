"""Aircraft of a rehearsal in virtual time, with the leader without a companion and the operator's orders."""

import heapq
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from random import Random
from struct import Struct

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import sitl_stub
from vfguide.companion.alerts import Event
from vfguide.companion.consent import MemoryStore
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan, local_frame
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.errors import InputError
from vfguide.formation.arrangement import Arrangement, Manoeuvre
from vfguide.lab.rehearsal.recorder import UNSEEN, VehicleRecorder
from vfguide.link.codec import is_leaders
from vfguide.link.memory import ROUNDING_S, LinkQuality, Mail, MemoryLink
from vfguide.link.order_codec import ORDER_MAGIC, REPLY_MAGIC, encode_order
from vfguide.mission.feasibility import follower_start, leader_start
from vfguide.mission.flight_path import path_of
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import timetable
from vfguide.record.tlog import TelemetryLog
from vfguide.registry import load_plugins_of_the_environment

BOOTED_S = 1234.5
"""Clock of a leader without a companion at the start of a rehearsal, s; it differs from all other clocks."""

DECLARED = (
    "alpha_1_s",
    "beta_1_s",
    "airspeed_range_m_s",
    "max_bank_deg",
    "max_acceleration_m_s2",
    "climb_range_m_s",
    "height_delay_s",
)
"""Fields of a mission's vehicle that its emulator uses unless it has values of its own."""

ROUTE_POINTS = 361

ROUTE_BEYOND_M = 1000.0
"""Length by which the route along an endless path exceeds what the aircraft can fly, m."""


def settings_of(mission: Mission, name: str) -> dict[str, object]:
    """Return the `sitl-stub --config` settings of a vehicle's emulator, the same for every kind of flight."""
    vehicle, rehearsal = mission.vehicles[name], mission.rehearsal
    emulator = rehearsal.emulator.of(name)
    leads = name == mission.leader.vehicle
    start = leader_start(mission) if leads else follower_start(mission, name)
    latitude, longitude = local_frame(mission).to_geodetic(start.north_m, start.east_m)
    ground = mission.origin.altitude_amsl_m
    altitude = ground + mission.height_above_origin_m + start.up_m
    declared = {field: getattr(vehicle, field) for field in DECLARED}
    lowest, highest = emulator.airspeed_range_m_s or vehicle.airspeed_range_m_s
    settings: dict[str, object] = {
        **declared,
        **emulator.model_dump(mode="json", exclude_none=True),
        "system_id": vehicle.system_id,
        "autopilot": emulator.autopilot or vehicle.emulated_autopilot,
        "plant": emulator.plant or vehicle.plant,
        "wind": mission.wind.model_dump(mode="json"),
        "air_height_m": mission.height_above_origin_m,
        "start": (float(latitude), float(longitude), altitude, start.course_deg),
        "home_altitude_m": ground,
        "airborne": True,
        "climb_m_s": start.climb_m_s,
        "airspeed_m_s": min(max(mission.leader.airspeed_m_s, lowest), highest),
        "sensors": rehearsal.sensors,
        "position_noise_m": rehearsal.position_noise_m,
        "seed": rehearsal.seed,
    }
    if leads and mission.leader.is_foreign:
        heard = rehearsal.leader_telemetry
        settings |= {
            "route": route_of(mission),
            "streams": [f"{heard.message}:{heard.rate_hz!r}"],
            "delay_s": heard.delay_s,
            "jitter_s": heard.jitter_s,
            "loss": heard.loss,
            "icao_address": mission.leader.icao_address or 0,
            "boot_time_s": BOOTED_S,
        }
    return settings


def checked_settings(mission: Mission, name: str) -> sitl_stub.Settings:
    """Return the settings of a vehicle's emulator.

    Raises:
        InputError: the emulator does not accept them; the message is one line.
    """
    load_plugins_of_the_environment()
    try:
        settings = sitl_stub.Settings.of(settings_of(mission, name))
        sitl_stub.plant_of(settings.config().plant)
    except ValueError as error:
        own = name in mission.rehearsal.emulator.vehicles
        place = f"rehearsal.emulator.vehicles.{name}" if own else "rehearsal.emulator"
        raise InputError(f"{place}: {error}") from error
    return settings


def emulator_of(
    mission: Mission, name: str, faults: tuple[sitl_stub.Fault, ...] = ()
) -> sitl_stub.Autopilot:
    """Return the emulator of a vehicle, in the air at its start, with faults in its reports."""
    settings = checked_settings(mission, name)
    return sitl_stub.Autopilot(
        settings.config().model_copy(update={"faults": faults}), settings.air()
    )


def foreign_leader_of(mission: Mission) -> sitl_stub.BadLink:
    """Return the emulated leader without a companion, heard over its imperfect link."""
    leader = mission.leader.vehicle
    return checked_settings(mission, leader).behind_its_link(emulator_of(mission, leader))


def route_of(mission: Mission) -> list[tuple[float, float]]:
    """Return (latitude, longitude) along a mission's path, degrees, for an aircraft without a companion."""
    path = path_of(mission.path)
    if math.isfinite(path.length):
        places = path.at(path.outline(ROUTE_POINTS))
    else:
        reach_m = mission.rehearsal.duration_s * mission.leader_vehicle.airspeed_range_m_s[1]
        places = path.at(np.linspace(0.0, reach_m + ROUTE_BEYOND_M, ROUTE_POINTS))
    frame = local_frame(mission)
    points = [
        frame.to_geodetic(float(north), float(east))
        for north, east in zip(places.north, places.east, strict=True)
    ]
    if math.isfinite(path.length):
        points[-1] = points[0]
    return points


OPERATOR = "operator"
"""Sender of orders on the links of a rehearsal."""

LEAD_S = 4.0
"""Time by which an order is sent ahead of its start, s."""

REPEAT_S = 0.5
"""Interval at which an order is sent again, s, since a link may lose it."""

TIMES = 6
"""Number of times that an order is sent."""

TIME = Struct("<d")
"""Arrival time of a datagram, s; its prefix in the mail of a leader without a companion."""

OrderMail = Sequence[tuple[float, bytes]]
"""Operator's messages as (time in s, data), in order of time."""

_newest: list[tuple[Mission, OrderMail]] = []


def mail_of(order: Arrangement) -> list[tuple[float, bytes]]:
    """Return (time in s, data) of each sending of an order; an abort has no lead time."""
    begins_s = order.time_s - (0.0 if order.flown is Manoeuvre.ABORT else LEAD_S)
    data = encode_order(order)
    return [(begins_s + REPEAT_S * number, data) for number in range(TIMES)]


def order_mail(mission: Mission) -> OrderMail:
    """Return the messages of all orders in a mission's time table."""
    # Cached, since every aircraft of a mission asks for them.
    if mission.orders and not (_newest and _newest[0][0] is mission):
        said = [one for order, _ in timetable(mission) for one in mail_of(order)]
        _newest[:] = [(mission, sorted(said))]
    return _newest[0][1] if mission.orders else ()


class EmulatedForeignLeader:
    """Emulated leader without a companion."""

    leads = True

    def __init__(self, mission: Mission, *, log: TelemetryLog | None = None) -> None:
        self.name = mission.leader.vehicle
        self.events = list[Event]()
        """Always empty."""
        self.recorder = VehicleRecorder(mission, self.name)
        self.log = log
        """Log of the telemetry that others hear, where one is kept."""
        self.emulator = foreign_leader_of(mission)

    def step(self, now: float, mail: Sequence[Mail]) -> list[Mail]:
        """Fly on to this time, s, and return the telemetry that has arrived as mail; ignore others' mail."""
        del mail
        emulator, heard = self.emulator, []
        while True:
            # Telemetry between two steps keeps its own arrival time, so that none is late by a step.
            arrival_s = min(emulator.next_due_s, now)
            if datagram := emulator.advance(arrival_s):
                heard.append((self.name, TIME.pack(arrival_s) + datagram))
                if self.log is not None:
                    self.log.add(arrival_s, datagram)
            if arrival_s >= now:
                break
        self.recorder.sample(emulator.truth(), UNSEEN)
        return heard


class LeaderAnswers:
    """Answers of a leader without a companion to a follower's TIMESYNC, with the latency of its telemetry.

    The leader flies ahead of its followers in virtual time and cannot be asked itself; its clock is known.
    """

    def __init__(self, mission: Mission, follower: str) -> None:
        self._heard = mission.rehearsal.leader_telemetry
        self._random = Random(f"{mission.rehearsal.seed} {follower} asks")
        self._codec = mavlink.MAVLink(None, srcSystem=mission.leader_vehicle.system_id)
        self._codec.srcComponent = mavlink.MAV_COMP_ID_AUTOPILOT1
        self._on_the_way: list[tuple[float, bytes]] = []

    def ask(self, datagram: bytes, now: float) -> None:
        """Take MAVLink data of the follower, and prepare the answers."""
        for message in self._codec.parse_buffer(datagram) or ():
            if message.get_type() != "TIMESYNC" or self._random.random() < self._heard.loss:
                continue
            there_s, back_s = self._travel_s(), self._travel_s()
            shown_ns = round((BOOTED_S + now + there_s) * 1e9)
            answer = mavlink.MAVLink_timesync_message(shown_ns, message.ts1)
            arrival_s = now + there_s + back_s
            heapq.heappush(self._on_the_way, (arrival_s, bytes(answer.pack(self._codec))))

    def due(self, now: float) -> Iterator[tuple[bytes, float]]:
        """Yield (answer, arrival time in s) of the answers that have arrived by this time."""
        while self._on_the_way and self._on_the_way[0][0] <= now:
            arrival_s, answer = heapq.heappop(self._on_the_way)
            yield answer, arrival_s

    def _travel_s(self) -> float:
        spread_s = self._heard.jitter_s
        return self._heard.delay_s + self._random.uniform(-spread_s, spread_s)


Instant = tuple[float, Sequence[Mail]]
"""Virtual time, s, and the mail that is handed to the links then."""


class Aircraft:
    """Emulated aircraft with its companion, in virtual time."""

    def __init__(
        self,
        mission: Mission,
        name: str,
        *,
        log: TelemetryLog | None = None,
        clock: SharedClock = SAME_CLOCK,
        orders: OrderMail | None = None,
        greeting_s: float = 0.0,
    ) -> None:
        """Put the aircraft of this name at its start; for `greeting_s` see `Companion`.

        `log` gets every datagram of the MAVLink connection. `clock` is the formation's, as this aircraft
        knows it. Without `orders` the operator gives those of the mission's time table.
        """
        rehearsal = mission.rehearsal
        quality = LinkQuality(
            delay_s=rehearsal.link_delay_s,
            jitter_s=rehearsal.link_jitter_s,
            loss=rehearsal.link_loss,
        )
        vehicle = mission.vehicles[name]
        plan = flight_plan(mission, name)
        self.name = name
        self.events = list[Event]()
        self.recorder = VehicleRecorder(mission, name)
        self.log = log
        self.emulator = emulator_of(mission, name)
        self._consent = MemoryStore()
        self._losses = tuple(loss for loss in rehearsal.losses if loss.vehicle == name)
        self._lost = False
        self._pilot = adapter_of(vehicle)
        self._taken_from: int | None = None
        self._make: Callable[[], Companion] = lambda: Companion(
            plan,
            adapter_of(vehicle),
            engage=True,
            clock=clock,
            consent=self._consent,
            greeting_s=greeting_s,
        )
        self.companion = self._make()
        """Companion; a loss replaces it by a new one without any state, as a restart does."""
        self.leads = plan.leads
        """Whether the aircraft is the mission's leader."""
        self._leader = mission.leader.vehicle
        self._answers = LeaderAnswers(mission, name) if mission.leader.is_foreign else None
        seeds = {other: f"{rehearsal.seed} {other} {name}" for other in mission.followers_by_name}
        seeds.pop(name, None)
        if not (plan.leads or self._answers):
            seeds[self._leader] = f"{rehearsal.seed} {name}"
        self._orders = deque(order_mail(mission) if orders is None else orders)
        if self._orders:
            seeds[OPERATOR] = f"{rehearsal.seed} {OPERATOR} {name}"
        self._link = MemoryLink(quality, seeds)
        self._replies = b""

    def step(self, now: float, mail: Sequence[Mail]) -> list[Mail]:
        """Fly on to this virtual time, s, step the companion and return the mail that it publishes.

        The link gets the others' mail now, and delivers it later or loses it.
        """
        gone = self.loses("companion", now)
        alone = gone or self.loses("link", now)
        while self._orders and self._orders[0][0] <= now + ROUNDING_S:
            order = self._orders.popleft()[1]
            self._link.send([] if alone else [(OPERATOR, order)], now)
        self._turn_switch(now)
        if gone:
            self._fly_alone(now)
            return []
        companion, emulator = self.companion, self.emulator
        self._hear(now, [] if alone else mail)
        telemetry = self._replies + emulator.advance(now)
        truth = emulator.truth()
        out = companion.receive_mavlink(telemetry, now)
        self._replies = emulator.receive(out.to_autopilot)
        if self._answers is not None:
            self._answers.ask(out.to_leader, now)
        self.events += out.events
        self.recorder.sample(truth, companion.snapshot)
        if self.log is not None:
            self.log.add(now, telemetry)
            self.log.add(now, out.to_autopilot)
        said = [*out.to_link, *out.to_followers, *out.replies, *out.repeats]
        return [] if alone else [(self.name, data) for data in said]

    def loses(self, what: str, now: float) -> bool:
        """Check whether the vehicle is now without its companion, its link or its guidance."""
        return any(loss.what == what and loss.lasts(now) for loss in self._losses)

    def _turn_switch(self, now: float) -> None:
        """Have the pilot take the vehicle over or give it back by the mode switch, without any notice."""
        taken, before = self.loses("guidance", now), self._taken_from
        if taken == (before is not None):
            return
        if before is None:
            self._taken_from, wanted = self.emulator.custom_mode, self._pilot.hand_back()
        else:
            system_id = self.emulator.config.system_id
            wanted = [mavlink.MAVLink_set_mode_message(system_id, 1, before)]
            self._taken_from = None
        self.emulator.receive(b"".join(one.pack(mavlink.MAVLink(None)) for one in wanted))

    def _fly_alone(self, now: float) -> None:
        """Fly on to this time without a companion; its successor starts without any state."""
        if not self._lost:
            self._lost, self.companion = True, self._make()
        self._replies = b""
        telemetry = self.emulator.advance(now)
        self._link.clear()
        self.recorder.sample(self.emulator.truth(), UNSEEN)
        if self.log is not None:
            self.log.add(now, telemetry)

    def _hear(self, now: float, mail: Sequence[Mail]) -> None:
        """Hand mail to the link, and to the companion what has arrived by now."""
        if self._answers is not None:
            heard = [
                (data[TIME.size :], TIME.unpack_from(data)[0])
                for sender, data in mail
                if sender == self._leader
            ]
            for datagram, arrival_s in [*heard, *self._answers.due(now)]:
                self.companion.receive_link(datagram, arrival_s)
        self._link.send(mail, now)
        for sender, data in self._link.receive(now):
            if data.startswith(ORDER_MAGIC):
                self.companion.receive_order(data, data, now, repeated=sender != OPERATOR)
            elif data.startswith(REPLY_MAGIC):
                self.companion.receive_reply(sender, data, now)
            elif is_leaders(data):
                self.companion.receive_lead(sender, data, now)
            elif sender == self._leader:
                self.companion.receive_link(data, now)
            else:
                self.companion.receive_neighbour(sender, data, now)


def aircraft_of(
    mission: Mission, name: str, *, log: TelemetryLog | None = None, orders: OrderMail | None = None
) -> Aircraft | EmulatedForeignLeader:
    """Return the aircraft of this name at its start; for the arguments see `Aircraft`."""
    if mission.leader.is_foreign and name == mission.leader.vehicle:
        return EmulatedForeignLeader(mission, log=log)
    return Aircraft(mission, name, log=log, orders=orders)


def step_all(
    formation: Sequence[Aircraft | EmulatedForeignLeader], now: float, mail: Sequence[Mail]
) -> list[Mail]:
    """Step each aircraft to this virtual time, s, leader first, and return all mail that they publish.

    The others get the leader's mail at the same time, and `mail`, which comes from elsewhere.
    """
    heard, published = list(mail), []
    for aircraft in formation:
        sent = aircraft.step(now, heard)
        if aircraft.leads:
            heard += sent
        published += sent
    return published


class Candidates:
    """Aircraft that may lead, the mission's leader first. All others hear their leader messages at once."""

    def __init__(self, aircraft: Sequence[Aircraft | EmulatedForeignLeader]) -> None:
        self._aircraft = aircraft
        self._said: list[tuple[int, Mail]] = []

    def step(self, now: float, mail: Sequence[Mail]) -> tuple[list[Mail], list[Mail]]:
        """Step each candidate to this virtual time, s; earlier ones hear later ones an instant later.

        Return mail that all others get now, and mail of deputies as followers, which takes the usual way.
        """
        before, self._said = self._said, []
        at_once: list[Mail] = []
        later: list[Mail] = []
        for number, one in enumerate(self._aircraft):
            missed = [said for sender, said in before if sender > number]
            for sent in one.step(now, [*mail, *missed, *at_once]):
                leads = is_leaders(sent[1])
                (at_once if leads or one.leads else later).append(sent)
                if leads:
                    self._said.append((number, sent))
        return at_once, later


def fly_window(
    formation: Sequence[Aircraft | EmulatedForeignLeader], window: Sequence[Instant]
) -> list[Mail]:
    """Let each follower in turn fly a whole window of the exchange, and return all mail that they publish.

    Followers do not hear each other within a window, so their order changes nothing. One aircraft and its
    companion stay in the processor's cache that way; a hundred do not fit into it.
    """
    return [
        sent for aircraft in formation for now, mail in window for sent in aircraft.step(now, mail)
    ]
