"""Whether a vehicle may be engaged by itself: what is kept over restarts, and by whom it is steered then."""

import json
import os
from concurrent.futures import wait
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import (
    HEADING,
    KINDS,
    LOITER,
    MESSAGE_INTERVAL,
    SET_MODE,
    Flight,
    assert_left_alone,
    heard_until,
    leader_bytes,
    new_flight,
    without,
)
from tests.kit.states import FRAME
from tests.kit.wire import flown_position, heartbeat, of_type, parsed, position_report, spoken
from vfguide.companion.consent import Consent, FileStore, default_directory, parse
from vfguide.companion.supervisor import Mode
from vfguide.link.member import ELDER

ARM = 400


class QuickDisk(FileStore):
    """One whose disk keeps up with virtual time, in which 20 s pass in half a second."""

    def save(self, consent: Consent) -> None:
        super().save(consent)
        wait([self._written])


def test_what_is_saved_is_found_by_the_next_process(tmp_path):
    directory = tmp_path / "new" / "state"
    spent = Consent(spent="it has been in GUIDED in this flight")
    store = FileStore(directory, "f1")
    store.load()
    store.save(spent)
    store.close()
    assert store.holds(spent)
    assert not store.holds(Consent())
    assert [file.name for file in directory.iterdir()] == ["f1.consent.json"]
    assert FileStore(directory, "f1").load().spent == spent.spent
    assert FileStore(directory, "f2").load() == Consent()


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"\xff\xfe", b"[" * 4000, b'{"version": 2, "spent": ""}', b'{"version": 1}'],
)
def test_a_damaged_file_is_no_consent(tmp_path, content):
    file = tmp_path / "f1.consent.json"
    file.write_bytes(content)
    store = FileStore(tmp_path, "f1")
    assert store.load().is_spent
    assert store.fault is not None
    fault = f"not engaged by itself: {file} cannot be read (damaged); mend it"
    assert store.fault.startswith(fault)
    # What is known again, on the ground, mends it.
    store.save(Consent())
    store.close()
    assert store.holds(Consent())
    assert json.loads(file.read_text()) == {"version": 1, "spent": "", "steered": False}


def test_a_pipe_or_a_directory_that_cannot_be_written_to_is_no_consent(tmp_path):
    os.mkfifo(tmp_path / "f1.consent.json")
    store = FileStore(tmp_path, "f1")
    assert store.load().is_spent
    assert store.fault is not None
    (tmp_path / "state").write_text("a file where the directory should be")
    store = FileStore(tmp_path / "state", "f1")
    consent = store.load()
    store.close()
    assert not store.holds(consent)
    assert store.fault is not None
    assert "--state" in store.fault


def test_state_lies_where_systemd_says_or_else_in_the_users_state_directory(monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", "/home/pilot/.state")
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/vfguide")
    assert default_directory() == Path("/var/lib/vfguide")
    monkeypatch.delenv("STATE_DIRECTORY")
    assert default_directory() == Path("/home/pilot/.state/vfguide")


@pytest.mark.parametrize("mode", ["RTL", "FBWA", "MANUAL", "LOITER"])
def test_a_companion_that_is_replaced_does_not_take_what_the_pilot_took(mode):
    flown = new_flight(until_s=10.0)
    assert flown.autopilot_mode == "GUIDED"
    flown.pilot(mode, until_s=12.0)
    flown.restart()
    flown.run(20.0)
    assert_left_alone(flown, mode, since_s=10.0)
    assert flown.mode is Mode.PILOT


@pytest.mark.parametrize("mode", ["RTL", "AUTO", "FBWA", "MANUAL"])
def test_a_companion_that_finds_the_aircraft_in_other_hands_leaves_it_there(mode):
    flown = new_flight()
    flown.pilot(mode, until_s=8.0)
    assert flown.times(SET_MODE) == []
    # Nor does a loiter that the pilot selects after that.
    flown.pilot("LOITER", until_s=14.0)
    assert flown.times(SET_MODE) == []
    assert any("to be steered" in text for _, text in flown.texts())


def test_after_a_hang_nothing_goes_by_what_was_said_meanwhile():
    flown = new_flight(until_s=10.0)
    flown.hang(29.0)
    flown.pilot("LOITER")
    flown.waiting = flown.waiting[:-200]
    flown.hang(30.0)
    flown.run(40.0)
    assert flown.later(HEADING, 10.1) == flown.later(SET_MODE, 10.0) == []
    assert flown.mode_at(40.0) is Mode.PILOT
    assert len(flown.told("stood still for 20 s")) == 1


def test_a_vehicle_that_is_disarmed_in_the_air_is_not_steered_on():
    flown = new_flight(until_s=10.0)
    flown.command(ARM, 0, 21196)
    flown.run(20.0)
    assert flown.later(HEADING, 11.1) == flown.later(SET_MODE, 10.0) == []
    assert flown.mode_at(20.0) is Mode.WAITING


def toward(value: float, wanted: float, step: float) -> float:
    return value + min(max(wanted - value, -step), step)


def asked(*spans: dict[str, Any], landed: int | None = None) -> list[float]:
    """When GUIDED is asked for in five seconds of these reports after what came before.

    Between two of them it climbs or sinks by 10 m/s and changes its speed by 4 m/s², armed.
    """
    companion, times, now, north = new_flight().companion, [], 0.0, 0.0
    speed, altitude = spans[0].get("speed", 20.0), spans[0].get("altitude", 588.0)
    answers: list[mavlink.MAVLink_message] = []
    for before, span in pairwise([spans[0], *spans]):
        wanted = (span.get("speed", 20.0), span.get("altitude", 588.0))
        left = round(span.get("length", 5.0) * 10)
        while left > 0:
            now = round(now + 0.1, 3)
            arrived = (speed, altitude) == wanted
            shown = span if arrived or span["armed"] else before
            left -= arrived
            speed, altitude = toward(speed, wanted[0], 0.4), toward(altitude, wanted[1], 1.0)
            north += 0.1 * speed
            companion.receive_link(leader_bytes(now), now)
            where = FRAME.to_geodetic(north, 0.0)
            place = flown_position(now, where, north_m_s=speed, altitude_m=altitude)
            beat = heartbeat(LOITER, status=shown["status"], armed=shown["armed"])
            messages = [*answers, beat, place]
            if landed is not None:
                messages.append(mavlink.MAVLink_extended_sys_state_message(0, landed))
            sent = parsed(companion.receive_mavlink(spoken(*messages), now).to_autopilot)
            times += [now for one in sent if getattr(one, "command", 0) == SET_MODE]
            answers = [
                mavlink.MAVLink_timesync_message(round(now * 1e9), one.ts1)
                for one in of_type(sent, "TIMESYNC")
            ]
    return times


STANDING = {"status": 3, "armed": False, "speed": 0.0, "altitude": 488.0}
FLYING = {"status": 4, "armed": True}


@pytest.mark.parametrize(
    "change", [{"status": 3}, {"status": 5}, {"armed": False}, {"speed": 5.0}, {"altitude": 500.0}]
)
def test_it_does_not_engage_on_the_ground_too_low_or_in_a_fail_safe(change):
    assert asked(FLYING | change) == []


@pytest.mark.parametrize(
    ("landed", "engages"), [(None, True), (0, False), (1, False), (2, True), (3, False), (4, False)]
)
def test_it_engages_in_the_air_unless_the_autopilot_says_that_it_is_not_there(landed, engages):
    assert bool(asked(FLYING, landed=landed)) is engages


@pytest.mark.parametrize(
    ("landed", "engages"),
    [
        (None, False),
        ({"length": 3.0}, False),
        ({"length": 7.0}, True),
        ({"length": 7.0, "speed": 20.0}, False),
        # In the air without a speed, as with the wind against it.
        ({"length": 7.0, "altitude": 588.0}, False),
    ],
)
def test_the_next_flight_begins_when_it_is_seen_disarmed_on_the_ground(landed, engages):
    # A fail-safe ends the consent of a flight, a landing that flight.
    between = [] if landed is None else [STANDING | landed]
    assert bool(asked(FLYING | {"status": 5}, *between, FLYING)) is engages


def test_a_reboot_in_the_air_does_not_end_the_flight():
    # For 9 s without a fix: disarmed, standing by, no speed. The pilot has taken LOITER before.
    flown = new_flight(until_s=8.0)
    flown.pilot("LOITER")

    def rebooted(now: float) -> bytes:
        passed_s = now - 8.0
        nowhere = position_report(time_boot_ms=max(round(passed_s * 1e3), 0), lat=0, lon=0, alt=0)
        beat = heartbeat(LOITER, status=3, armed=False)
        return spoken(nowhere, beat) if 0.0 < passed_s <= 9.0 else b""

    flown.run(17.0, deaf=True, forge=rebooted)
    flown.run(24.0, deaf=False)
    assert_left_alone(flown, "LOITER", since_s=8.0)


@pytest.mark.parametrize("hung", [True, False])
def test_a_stop_after_a_hang_or_before_guided_shows_is_followed_by_handing_back(hung):
    flown = new_flight(until_s=8.0 if hung else 1.05)
    assert flown.times(SET_MODE) == [1.0]
    if hung:
        flown.hang(12.0)
        flown.companion.receive_mavlink(b"", 12.0)
    flown.companion.stop(12.1 if hung else 1.06)
    assert not flown.companion.released
    flown.run(flown.now + 10.0)
    assert flown.autopilot_mode == "LOITER"
    assert flown.companion.released


def test_guided_of_the_pilots_own_is_not_undone_where_nothing_was_steered():
    hasty = {"prediction_s": 1.0, "breakaway_s": 1.0}
    flown = new_flight(engage=False, link=heard_until(1.0), patience=hasty, until_s=4.0)
    flown.pilot("GUIDED", until_s=9.0)
    assert_left_alone(flown, "GUIDED")
    assert [text.removeprefix("vfguide f1: ") for _, text in flown.texts()] == [
        "not steering, no position or no leader heard; watch it, or take over",
        "nothing to steer by: it stays in GUIDED, unsteered; watch it, or select another mode",
    ]


def test_a_speed_that_every_mode_obeys_is_not_sent_without_heartbeats():
    flown = new_flight(kind="px4", until_s=5.0)
    assert flown.mode_at(5.0).steers
    flown.run(9.0, edit=without("HEARTBEAT"))
    assert flown.later(178, 6.0)
    assert flown.later(178, 7.6) == []


def test_a_state_that_cannot_be_kept_is_told_at_the_start(tmp_path):
    file = tmp_path / "f1.consent.json"
    file.write_text("[" * 4000)
    flown = new_flight(store=FileStore(tmp_path, "f1"), link=lambda _now: [], until_s=0.2)
    assert any("cannot be read (damaged)" in text for _, text in flown.texts())


@pytest.mark.parametrize("lost", [True, False])
def test_a_record_that_is_lost_in_the_air_leaves_the_vehicle_to_its_pilot(tmp_path, lost):
    store = QuickDisk(tmp_path, "f1")
    flown = new_flight(store=store, until_s=20.0)
    flown.pilot("LOITER", until_s=24.0)
    store.close()
    if lost:
        (tmp_path / "f1.consent.json").unlink()
    flown.run(34.0, companion=new_flight(store=QuickDisk(tmp_path, "f1")).companion)
    assert flown.later(SET_MODE, 20.0) == []
    (told,) = flown.told("not engaged by", from_s=24.0)
    assert ("no record of this flight was found: select GUIDED" in told) is lost
    flown.pilot("GUIDED", until_s=40.0)
    assert flown.mode_at(40.0).steers


BACK = "nothing to steer by: handed back to the autopilot, watch that it loiters"


def replaced(flown: Flight, gap_s: float) -> None:
    """The process is killed, and for some time nobody hears the autopilot or speaks to it."""
    flown.hang(flown.now + gap_s)
    flown.waiting = b""
    flown.restart()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("gap_s", [0.5, 2.0, 3.5])
def test_a_vehicle_whose_new_companion_hears_no_leader_is_handed_back(kind, gap_s):
    flown = new_flight(kind=kind, link=heard_until(15.0), until_s=15.0)
    replaced(flown, gap_s)
    flown.run(40.0)
    assert flown.autopilot_mode == "LOITER"
    (time,) = flown.later(SET_MODE, 15.0)
    assert 25.0 + gap_s < time < 29.0 + gap_s
    assert sum(BACK in text for _, text in flown.texts()) == 1
    # No pilot is named who does not fly.
    later = [text for said_s, text in flown.texts() if said_s > 15.0]
    assert [text for text in later if "the pilot flies" in text or "by hand" in text] == []
    # It is the pilot's from then on.
    flown.run(60.0)
    assert flown.later(SET_MODE, time) == []


@pytest.mark.parametrize("kind", KINDS)
def test_a_vehicle_whose_new_companion_hears_no_positions_is_handed_back(kind):
    flown = new_flight(kind=kind, until_s=15.0)
    flown.command(MESSAGE_INTERVAL, 33, -1)
    replaced(flown, 2.0)
    flown.run(40.0, lose=frozenset({MESSAGE_INTERVAL, "REQUEST_DATA_STREAM"}))
    assert flown.autopilot_mode == "LOITER"
    assert sum(BACK in text for _, text in flown.texts()) == 1


def test_a_vehicle_that_does_not_obey_its_new_companion_is_handed_back_three_times():
    flown = new_flight(link=heard_until(15.0), until_s=15.0)
    replaced(flown, 2.0)
    flown.run(60.0, lose=frozenset({SET_MODE}))
    assert len(flown.later(SET_MODE, 15.0)) == 3
    assert any("although it was handed back 3 times" in text for _, text in flown.texts())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("gap_s", [0.0, 2.0])
def test_a_new_companion_that_hears_everything_steers_on(kind, gap_s):
    flown = new_flight(kind=kind, until_s=20.0)
    replaced(flown, gap_s)
    flown.run(50.0)
    assert_left_alone(flown, "GUIDED", since_s=20.0)
    assert flown.companion.snapshot.mode.steers


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_companion_that_is_stopped_hands_back(kind):
    flown = new_flight(kind=kind, link=heard_until(15.0), until_s=15.0)
    replaced(flown, 2.0)
    flown.run(20.0)
    flown.companion.stop(flown.now)
    flown.run(25.0)
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize("kind", KINDS)
def test_guided_that_the_pilot_gave_after_taking_over_is_not_handed_back_by_a_new_companion(kind):
    flown = new_flight(kind=kind, link=heard_until(15.0), until_s=15.0)
    flown.pilot("LOITER", until_s=18.0)
    flown.pilot("GUIDED", until_s=18.5)
    flown.pilot("LOITER", until_s=20.0)
    replaced(flown, 2.0)
    flown.run(25.0)
    flown.pilot("GUIDED", until_s=60.0)
    assert_left_alone(flown, "GUIDED", since_s=15.0)


@pytest.mark.parametrize("engage", [True, False])
def test_who_steers_is_on_the_disk_and_nobody_does_once_the_pilot_has_taken_over(tmp_path, engage):
    flown = new_flight(store=QuickDisk(tmp_path, "f1"), engage=engage, until_s=5.0)
    file = tmp_path / "f1.consent.json"
    assert parse(file.read_bytes()).steered is engage
    flown.pilot("GUIDED", until_s=10.0)
    assert parse(file.read_bytes()).steered
    flown.pilot("LOITER", until_s=12.0)
    kept = parse(file.read_bytes())
    assert (kept.steered, kept.is_spent) == (False, True)


def test_the_younger_hands_back_the_vehicle_that_it_steers_and_says_why():
    one = new_flight(until_s=10.0)
    assert one.mode.steers
    out = one.companion.stand_back(one.now, ELDER)
    assert "another companion of this name was here before" in out.events[0].text
    assert not one.companion.stand_back(one.now, ELDER).events
    one.run(15.0)
    assert not one.mode.steers
    assert one.autopilot_mode == "LOITER"
    assert one.companion.obstacle(one.now) == ELDER


def test_the_younger_that_has_not_steered_commands_nothing_until_the_other_is_silent():
    """The other one may steer this very vehicle."""
    one = new_flight()
    one.companion.stand_back(0.0, ELDER)
    one.run(10.0)
    assert {mode for _, mode in one.modes} == {Mode.WAITING}
    assert one.autopilot_mode == "LOITER"
    one.companion.stand_back(one.now, "")
    one.run(20.0)
    assert one.mode.steers
    assert one.autopilot_mode == "GUIDED"
