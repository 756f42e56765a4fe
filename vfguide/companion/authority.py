"""Decision on who steers, from what the autopilot shows and from the consent for this flight.

The pilot always wins. This companion enters the guided mode by itself once in a flight, out of modes that the
mission allows. Then only the pilot brings it back, or an operator's order if an order had sent the vehicle
away. This also holds after a restart: `RIGHTS` is the whole life of that right. A mode is commanded only in
answer to a heartbeat that has not waited in a radio: it shows the mode that would be left. Only what this
companion has steered is handed back.
"""

import math
from enum import Enum

import msgspec
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.alerts import Alerts
from vfguide.companion.consent import Consent, ConsentStore, FlightPhase
from vfguide.companion.supervisor import Control
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.announcements import WARNING
from vfguide.mavlink.reports import CommandReport, HeartbeatReport
from vfguide.transitions import transitions

SETTLED_S = 2.5
"""A mode is settled after this long without a sign of any other, s. Forged heartbeats stand between true
ones, which come once a second, and one of those may get lost."""

LEAST_RUN_S = 0.5
"""Shortest run of heartbeats that settles a mode, s: a single one does not."""

ALIVE_S = 1.0
"""Heartbeats without other telemetry in this time, s, are not believed: where the true autopilot is not
heard, all of them may be forged. It is asked for telemetry once a second, and answers."""

LOST_S = 5.0
"""Time without a heartbeat after which the mode is unknown, s."""

FRESH_S = 2.5
"""Age of a heartbeat up to which it shows the present mode, s: one may get lost, two may not."""

UNSEEN_S = 2.25
"""Gap between heartbeats beyond which the pilot may have flown unseen, s: one may get lost."""

YOUNG_S = 1.25
"""Greatest possible age of a heartbeat that a mode command answers, s: a later change would be unseen.
It allows a round trip of 0.7 s, or one lost answer: questions go out twice a second."""

LATE_TELEMETRY_S = 5.0
"""Time without a young enough heartbeat after which the pilot is told, s."""

ANSWER_S = 3.0
"""Time in which heartbeats may show that a request for the guided mode was obeyed, s."""

RETURN_SHOWS_S = 3.0
"""Time in which a hand-back shows in the heartbeats, s; a later change is the pilot's."""

MOST_RETURNS = 3
"""Limit on commands for one hand-back."""

LONGEST_PAUSE_S = 32.0
"""Longest pause between requests for the guided mode, s; pauses double from 1 s."""

YOUNG_AUTOPILOT_S = 12.0
"""Uptime below which the autopilot cannot have been steered before, s; simulated ones start in the air."""

JITTER_S = 0.25
"""Time by which heartbeats may come early, s."""

TAKE_OFFS = frozenset({"TAKEOFF", "VTOL_TAKEOFF"})

FAILSAFES = frozenset(
    {mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY, mavlink.MAV_STATE_FLIGHT_TERMINATION}
)


class Wish(Enum):
    """Mode change that the companion wants."""

    NONE = "none"
    STEER = "steer"
    """The autopilot should be steered: there is something to fly."""
    RETURN = "return"
    """The autopilot should fly by itself: there is nothing to steer by."""


class Right(Enum):
    """Right of the companion to enter the guided mode by itself, once in a flight."""

    FREE = "free"
    """Not used yet."""
    ASKING = "asking"
    """In use: the guided mode was requested and does not show yet."""
    SPENT = "spent"
    """Used or lost: only the pilot can engage the guided mode."""
    FLOWN = "flown"
    """Spent, and the guided mode was seen: the pilot has been told the reason."""


class Sign(Enum):
    """Event that may change the right."""

    GUIDED = "guided"
    """The autopilot is in the guided mode."""
    HOME = "home"
    """The autopilot flies home."""
    FAILSAFE = "fail-safe"
    """The autopilot reports a fail-safe."""
    CHOSEN = "chosen"
    """The pilot has selected another mode in the air."""
    ELSEWHERE = "elsewhere"
    """The autopilot has left the mode from which the guided one was requested."""
    UNSEEN = "unseen"
    """Heartbeats were missed for a while, or this process stood still."""
    UNHEARD = "unheard"
    """Heartbeats were missed for a while, and the vehicle flies."""
    UNRECORDED = "unrecorded"
    """The vehicle flies, and no record of its flight was found."""
    REBOOTED = "rebooted"
    """The autopilot has restarted in flight."""
    ASKS = "asks"
    """This companion requests the guided mode."""
    RENEWED = "renewed"
    """An operator orders a vehicle back that an order had left to its autopilot."""
    OVER = "over"
    """The flight has ended on the ground."""


RIGHTS = """
|        | guided | home   | fail-safe | chosen | elsewhere | unseen | unheard | unrecorded | rebooted | asks   | renewed | over |
| ------ | ------ | ------ | --------- | ------ | --------- | ------ | ------- | ---------- | -------- | ------ | ------- | ---- |
| free   | flown  | spent  | spent     | spent  | free      | free   | spent   | spent      | spent    | asking | free    | free |
| asking | flown  | asking | spent     | asking | spent     | spent  | spent   | asking     | spent    | asking | free    | free |
| spent  | flown  | spent  | spent     | spent  | spent     | spent  | spent   | spent      | spent    | spent  | free    | free |
| flown  | flown  | flown  | flown     | flown  | flown     | flown  | flown   | flown      | flown    | flown  | free    | free |
"""  # noqa: E501 - a table
"""Next right by present right (rows) and sign (columns)."""

NEXT_RIGHT = transitions(RIGHTS, Right, Sign)


class EngageRule(msgspec.Struct, frozen=True, kw_only=True):
    """Rule for entering the guided mode without the pilot."""

    allowed: bool
    """Whether it is allowed at all."""
    modes: tuple[str, ...]
    """Modes out of which it is allowed, as ground stations call them."""


class ModeAuthority:
    """Authority over the mode of one autopilot."""

    def __init__(
        self,
        adapter: AutopilotAdapter,
        rule: EngageRule,
        store: ConsentStore,
        phase: FlightPhase,
        alerts: Alerts | None = None,
    ) -> None:
        self._adapter = adapter
        self._rule = rule
        self._store = store
        self._phase = phase
        self._consent = store.load()
        # This companion must hand back what the one before it has steered.
        self._inherited = self._consent.steered
        self._may_be_lost = store.was_missing
        self._up_s = math.inf
        self._stranger: str | None = None
        self._alerts = alerts or Alerts()
        self._right = Right.SPENT if self._consent.is_spent else Right.FREE
        self._asked_mode: int | None = None
        self._asks = 0
        self._next_ask = self._request_time = -math.inf
        self._steered = False
        self._returns = 0
        self._return_time = -math.inf
        self._late_since: float | None = None
        self._unsettled_since = math.inf
        self._gap_s = 0.0
        self._previous: HeartbeatReport | None = None
        self.connected = False
        """Whether a heartbeat was ever received."""
        self.forget()
        self._unseen = False

    @property
    def recognised(self) -> bool:
        """Whether nothing contradicts that this is the adapter's autopilot."""
        return self._stranger is None

    @property
    def stranger(self) -> str | None:
        """Reason why the autopilot heard is not the adapter's; None where it is."""
        return self._stranger

    @property
    def shows_guided(self) -> bool:
        """Whether the newest heartbeat, of any age, shows the guided mode."""
        return self._beat is not None and self._adapter.is_engaged(self._beat.custom_mode)

    @property
    def shows_disarmed(self) -> bool:
        """Whether the newest heartbeat, of any age, shows a disarmed vehicle."""
        return self._beat is not None and not self._beat.armed

    @property
    def answers_for_vehicle(self) -> bool:
        """Whether the vehicle flies by this companion's setpoints since it was last in other hands.

        A request for the guided mode counts until heartbeats show its result.
        """
        return self._steered or math.isfinite(self._request_time)

    def is_current(self, now: float) -> bool:
        """Check whether the newest heartbeat is recent enough to show the mode at `now`, s."""
        return self._beat is not None and now - self._beat_time <= FRESH_S

    def silence_s(self, now: float) -> float:
        """Return the time since the last heartbeat, s; infinite before the first."""
        return now - self._beat_time

    def note_steering(self) -> None:
        """Note that a setpoint was sent."""
        self._steered = True
        self._keep()

    def mode_name(self) -> str:
        """Return the ground stations' name of the mode last heard."""
        return "no mode" if self._beat is None else self._adapter.mode_name(self._beat.custom_mode)

    def control(self, now: float) -> Control:
        """Return who controls the vehicle."""
        if self._beat is None or now - self._beat_time > LOST_S:
            return Control.UNKNOWN
        if not self._adapter.is_ready:
            # The adapter does not know the number of the guided mode yet.
            return Control.UNKNOWN
        if not self._beat.armed:
            return Control.DISARMED
        if self.shows_guided:
            denied = now - self._denied_time <= SETTLED_S
            return Control.PILOT if denied else Control.GUIDED
        if self._returned:
            return Control.RETURNED
        return Control.PILOT if self._is_spent else Control.FREE

    def note_store(self) -> None:
        """Tell the pilot if the consent cannot be stored."""
        if self._rule.allowed and self._store.fault is not None:
            self._notice(self._store.fault)

    def forget(self) -> None:
        """Forget all heartbeats, which are too old after a hang of this process."""
        self._beat: HeartbeatReport | None = None
        self._beat_time = self._changed_time = self._denied_time = -math.inf
        self._run_began = math.inf
        self._life_time = -math.inf
        self._returned = False
        self._unseen = True

    def hear(self, report: HeartbeatReport, now: float) -> str | None:
        """Process a heartbeat; return a complaint about a foreign autopilot once."""
        complaint, before = self._adapter.recognise(report.autopilot), self._stranger
        self._stranger = complaint
        self.connected = True
        if complaint is not None:
            # Mode numbers mean something else on every autopilot.
            self._beat = None
            return complaint if complaint != before else None
        previous, self._previous = self._previous, report
        self._note(report, now)
        self._watch_consent(report, previous, now)
        self._keep()
        return None

    def hear_answer(self, report: CommandReport, now: float) -> None:
        """Process a command acknowledgement: some are given only outside the guided mode."""
        if self._adapter.denies_guided(report):
            self._denied_time = self._changed_time = now

    def note_uptime(self, boot_time_s: float) -> None:
        """Note the uptime of the autopilot, s: nobody can have steered it before."""
        self._up_s = boot_time_s

    def note_life(self, now: float) -> None:
        """Note telemetry other than a heartbeat."""
        self._life_time = now

    def commands(self, wish: Wish, now: float, *, age_s: float) -> list[MAVLink_message]:
        """Return mode commands in answer to a heartbeat received at `now`, s, and at most `age_s` old."""
        if wish is not Wish.RETURN:
            self._returns = 0
        if self._beat is None or self._beat_time != now:
            return []
        if self.shows_guided and wish is Wish.RETURN:
            return self._hand_back(age_s, now)
        if wish is Wish.STEER and self._rule.allowed and not self.shows_guided:
            return self._ask(self._beat, age_s, now)
        return []

    def renew(self) -> None:
        """Allow one more engagement, as an operator orders the vehicle back that an order had sent away.

        If a pilot has flown it since, the pilot must engage it.
        """
        if not self._returned:
            self._notice(f"ordered back into the formation: select {self._adapter.engaged_name}")
            return
        self._asks, self._next_ask = 0, -math.inf
        self._note_sign(Sign.RENEWED)

    def rebooted(self) -> None:
        """End the right to engage, as the autopilot reports a restart, unless it stands on the ground."""
        stands = self._phase.is_over
        self._phase.forget()
        self._returned = False
        if stands:
            return
        self._note_sign(Sign.REBOOTED, "the autopilot has rebooted in this flight")
        self._notice(
            "the autopilot has rebooted: it is not engaged again by itself;"
            f" select {self._adapter.engaged_name} to be steered"
        )

    def _is_young(self, age_s: float, now: float) -> bool:
        """Check whether a heartbeat shows the present mode; warn the pilot if none has for a while."""
        # An age of NaN is unknown, and fails this test too.
        if age_s <= YOUNG_S:
            self._late_since = None
            return True
        if self._late_since is None:
            self._late_since = now
        if now - self._late_since >= LATE_TELEMETRY_S:
            self._notice(
                "telemetry comes late: the autopilot's mode is not changed by this companion;"
                " check the radio, or select a mode by hand"
            )
        return False

    def _note(self, report: HeartbeatReport, now: float) -> None:
        before = self._beat
        if before is not None:
            self._gap_s = now - self._beat_time
        if before is not None and now - self._beat_time > UNSEEN_S:
            self._unseen = True
        guided = self._adapter.is_engaged(report.custom_mode)
        handed_back = self._adapter.is_handed_back(report.custom_mode)
        if before is None or now - self._beat_time > SETTLED_S:
            self._run_began = now
        elif before.custom_mode != report.custom_mode or before.armed != report.armed:
            self._run_began = self._changed_time = now
        if guided:
            self._steered = self.answers_for_vehicle or self._inherited
            self._request_time = -math.inf
            self._returned = False
        else:
            self._note_other_mode(before, handed_back=handed_back, now=now)
        if self._unseen or report.status in FAILSAFES:
            # An order to return must not restore a right that has ended in the meantime.
            self._returned = False
        self._beat, self._beat_time = report, now

    def _note_other_mode(
        self, before: HeartbeatReport | None, *, handed_back: bool, now: float
    ) -> None:
        self._steered = False
        if self._adapter.is_ready:
            self._inherited = False
        if now - self._request_time > ANSWER_S:
            self._request_time = -math.inf
        if before is None or self._adapter.is_engaged(before.custom_mode):
            self._returned = handed_back and now - self._return_time <= RETURN_SHOWS_S
            self._returns = 0
        else:
            self._returned = self._returned and handed_back

    def _watch_consent(
        self, report: HeartbeatReport, previous: HeartbeatReport | None, now: float
    ) -> None:
        """Look for what ends the right to engage, and for the end of the flight, which restores it."""
        if self._phase.hear(report, now) and self._consent != Consent():
            self._steered = self._inherited = False
            self._asks, self._next_ask = 0, -math.inf
            self._alerts.forget("authority")
            self._set(Consent())
            self._note_sign(Sign.OVER)
        self._watch_gap(now)
        self._watch_record(now)
        if not report.armed:
            return
        name = self._adapter.mode_name(report.custom_mode)
        if self.shows_guided:
            self._note_sign(Sign.GUIDED, f"it has been in {name} in this flight")
        elif report.status in FAILSAFES:
            self._note_sign(Sign.FAILSAFE, "the autopilot has reported a fail-safe in this flight")
        elif self._adapter.goes_home(report.custom_mode):
            self._note_sign(Sign.HOME, f"it has been in {name} in this flight")
        elif self._is_pilots_change(report, previous) and not self._phase.is_on_ground(now):
            self._note_sign(Sign.CHOSEN, f"{name} was selected in the air")
        if report.custom_mode != self._asked_mode:
            self._note_sign(Sign.ELSEWHERE)

    def _watch_gap(self, now: float) -> None:
        """Process a time without heartbeats, or without this process: the pilot may have flown meanwhile."""
        if not self._unseen:
            return
        self._note_sign(Sign.UNSEEN)
        if self._phase.is_on_ground(now):
            self._unseen = False
        elif self._phase.flies(now):
            self._unseen = False
            self._note_sign(Sign.UNHEARD, "its heartbeats were not heard for a while in the air")

    def _watch_record(self, now: float) -> None:
        """Spend the right of a vehicle in the air without a record: its pilot may have taken it over."""
        if not self._may_be_lost:
            return
        if self._phase.is_on_ground(now):
            self._may_be_lost = False
        elif self._phase.flies(now):
            self._may_be_lost = False
            if self._up_s > YOUNG_AUTOPILOT_S:
                self._note_sign(Sign.UNRECORDED, "no record of this flight was found")

    def _is_pilots_change(self, report: HeartbeatReport, previous: HeartbeatReport | None) -> bool:
        """Check whether the pilot has selected another mode; the autopilot itself ends a take-off."""
        if previous is None or previous.custom_mode == report.custom_mode:
            return False
        return self._adapter.mode_name(previous.custom_mode) not in TAKE_OFFS

    @property
    def _is_spent(self) -> bool:
        """Whether only the pilot may engage the guided mode."""
        return self._right in {Right.SPENT, Right.FLOWN}

    def _note_sign(self, sign: Sign, reason: str = "") -> None:
        """Change the right by a sign, and store the reason of a change for the pilot."""
        before, self._right = self._right, NEXT_RIGHT[self._right][sign]
        if self._right is not before and Right.FREE in {before, self._right}:
            self._set(replace(self._consent, spent=reason))

    def _keep(self) -> None:
        """Store who steers for the companion after a restart."""
        steered = self.answers_for_vehicle or self._inherited or self._right is Right.ASKING
        if steered is not self._consent.steered:
            self._set(replace(self._consent, steered=steered))

    def _set(self, consent: Consent) -> None:
        if consent != self._consent:
            self._consent = consent
            self._store.save(consent)

    def _is_settled(self, now: float, *, run_s: float) -> bool:
        """Check that no other mode was indicated lately and heartbeats of a live autopilot show this one."""
        alive = now - self._life_time <= ALIVE_S
        unbroken = now - self._run_began >= run_s
        return alive and unbroken and now - self._changed_time >= SETTLED_S

    def _hand_back(self, age_s: float, now: float) -> list[MAVLink_message]:
        if not self._is_settled(now, run_s=SETTLED_S) or self._returns > MOST_RETURNS:
            return []
        if not self.answers_for_vehicle:
            self._notice(
                f"nothing to steer by: it stays in {self.mode_name()}, unsteered;"
                " watch it, or select another mode"
            )
            return []
        if not self._is_young(age_s, now):
            return []
        self._returns += 1
        if self._returns > MOST_RETURNS:
            self._alerts.say(
                "hand-back",
                WARNING,
                f"the autopilot stays in {self.mode_name()} although it was handed back"
                f" {MOST_RETURNS} times: take it by hand",
            )
            return []
        self._return_time = now
        return self._adapter.hand_back()

    def _ask(self, beat: HeartbeatReport, age_s: float, now: float) -> list[MAVLink_message]:
        settled = self._is_settled(now, run_s=LEAST_RUN_S)
        self._watch_interval(now, settled=settled)
        # The pilot was told the reason when the guided mode was left.
        if not settled or self._right is Right.FLOWN:
            return []
        obstacle = self._obstacle(beat, now)
        if obstacle is not None:
            self._notice(obstacle)
            return []
        if not self._is_young(age_s, now):
            return []
        if self._right is not Right.ASKING:
            self._asked_mode = beat.custom_mode
            self._note_sign(Sign.ASKS, "it has asked for the guided mode once in this flight")
            self._keep()
        if not self._store.holds(self._consent):
            # It is being written to the disk, or cannot be.
            if self._store.fault is not None:
                self._notice(self._store.fault)
            return []
        if now < self._next_ask:
            return []
        self._next_ask = now + min(2.0**self._asks, LONGEST_PAUSE_S) - JITTER_S
        self._asks += 1
        if self._asks == 2:
            self._notice(
                f"the autopilot stays in {self.mode_name()} although it was asked for"
                f" {self._adapter.engaged_name}: it is asked again, less and less often;"
                " see what it says, or select the mode by hand"
            )
        self._request_time = now
        return self._adapter.engage()

    def _watch_interval(self, now: float, *, settled: bool) -> None:
        """Warn the pilot if heartbeats come too rarely to show a mode that may be left."""
        self._unsettled_since = math.inf if settled else min(self._unsettled_since, now)
        if self._gap_s > SETTLED_S and now - self._unsettled_since >= LATE_TELEMETRY_S:
            self._notice(
                f"a heartbeat comes every {self._gap_s:.0f} s, too seldom to engage by: let one come each"
                f" second (radio, its stream rates), or select {self._adapter.engaged_name}"
            )

    def _obstacle(self, beat: HeartbeatReport, now: float) -> str | None:
        """Return why the guided mode is not entered automatically, with the remedy; None where it may be."""
        engaged, name = self._adapter.engaged_name, self._adapter.mode_name(beat.custom_mode)
        by_hand = f"select {engaged} to be steered"
        if self._store.fault is not None:
            return self._store.fault
        if self._is_spent:
            return f"not engaged by itself, {self._consent.spent}: {by_hand}"
        if not beat.armed:
            return "the vehicle is not armed: engaged once it flies; arm it when ready"
        if name not in self._rule.modes:
            return (
                f"not engaged out of {name}: select {' or '.join(self._rule.modes)}, or {engaged}"
            )
        return self._phase.obstacle(now, holds_altitude=self._adapter.holds_altitude)

    def _notice(self, text: str) -> None:
        """Tell the pilot something, once in a flight."""
        self._alerts.say(f"authority: {text}", WARNING, text, quiet_s=math.inf)
