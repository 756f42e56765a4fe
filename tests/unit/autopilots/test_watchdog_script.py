"""The watchdog in ArduPlane's Lua, run by an interpreter with stand-ins for the autopilot's bindings."""

import struct
from pathlib import Path
from typing import Any

import pytest
from lupa.lua54 import LuaRuntime
from pymavlink.dialects.v20 import ardupilotmega as mavlink

SCRIPT = Path(__file__).parents[3] / "examples" / "ardupilot" / "watchdog.lua"

MANUAL, AUTO, LOITER, GUIDED = 0, 10, 12, 15
COMPANION, GROUND_STATION = 191, 190
HEADING = mavlink.MAV_CMD_GUIDED_CHANGE_HEADING

BINDINGS = """
autopilot = {now = 0, mode = 0, armed = true, refuses = false}
autopilot.messages, autopilot.wanted, autopilot.modes, autopilot.texts = {}, {}, {}, {}

-- ArduPilot's uint32_t: no number of Lua's.
local Time = {}
Time.__index = Time
Time.__sub = function(one, other) return setmetatable({one[1] - other[1]}, Time) end
Time.tofloat = function(time) return time[1] end

function millis() return setmetatable({autopilot.now}, Time) end
mavlink, vehicle, arming, gcs = {}, {}, {}, {}
function mavlink:init() end
function mavlink:register_rx_msgid(number) autopilot.wanted[number] = true end
function mavlink:receive_chan() return table.remove(autopilot.messages, 1) end
function vehicle:get_mode() return autopilot.mode end
function vehicle:set_mode(mode)
  table.insert(autopilot.modes, mode)
  if autopilot.refuses then return false end
  autopilot.mode = mode
  return true
end
function arming:is_armed() return autopilot.armed end
function gcs:send_text(severity, text) table.insert(autopilot.texts, text) end
"""


class Plane:
    """An autopilot that runs the script."""

    def __init__(self, *, mode: int, long_system_id: bool = False) -> None:
        self._long = long_system_id
        # Messages are bytes, no text.
        self._lua = LuaRuntime(encoding=None)
        self._lua.execute(BINDINGS.encode())
        self.state: Any = self._lua.globals()[b"autopilot"]
        self.mode = mode
        self._update, self._period = self._lua.execute(SCRIPT.read_bytes())

    @property
    def mode(self) -> int:
        return int(self.state[b"mode"])

    @mode.setter
    def mode(self, mode: int) -> None:
        self.state[b"mode"] = mode

    @property
    def selected(self) -> list[int]:
        """Modes that the script has selected, refused or not."""
        return [int(one) for one in self.state[b"modes"].values()]

    @property
    def texts(self) -> list[str]:
        return [one.decode() for one in self.state[b"texts"].values()]

    def hear(self, command: int = HEADING, component: int = COMPANION) -> None:
        """Receive a COMMAND_INT, as the firmware's structure mavlink_message_t."""
        message = mavlink.MAVLink_command_int_message(1, 1, 0, command, 0, 0, 0, 90, 0, 0, 0, 0, 0)
        frame = message.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=component))
        head, system, rest, size = frame[:5], frame[5], frame[6:-2], 291
        source = struct.pack("<B", system)
        if self._long:
            source, size = struct.pack("<I", system), 299
        assert self.state[b"wanted"][message.get_msgId()]
        self._lua.globals().table.insert(
            self.state[b"messages"], (frame[-2:] + head + source + rest).ljust(size, b"\0")
        )

    def fly(self, seconds: float, *, setpoints: bool = False) -> None:
        """Let time pass, with two setpoints in a second or without any."""
        for step in range(round(seconds * 1000 / self._period)):
            self.state[b"now"] += self._period
            if setpoints and step % 5 == 0:
                self.hear()
            self._update, self._period = self._update()


@pytest.mark.parametrize("long_system_id", [False, True])
def test_while_setpoints_come_it_does_nothing_and_when_they_stop_it_loiters_once(long_system_id):
    plane = Plane(mode=GUIDED, long_system_id=long_system_id)
    plane.fly(20.0, setpoints=True)
    plane.fly(2.5)
    assert plane.selected == []
    plane.fly(20.0)
    assert plane.selected == [LOITER]
    assert plane.texts == ["watchdog: 3 s without setpoint, LOITER"]


@pytest.mark.parametrize("mode", [MANUAL, AUTO, LOITER])
def test_in_another_mode_or_disarmed_it_does_nothing(mode):
    plane = Plane(mode=mode)
    plane.fly(10.0)
    plane.mode, plane.state[b"armed"] = GUIDED, False
    plane.fly(10.0)
    assert plane.selected == []
    assert plane.texts == []


def test_the_pilots_guided_gives_the_companion_3_s_again():
    plane = Plane(mode=GUIDED)
    plane.fly(3.2)
    assert plane.selected == [LOITER]
    plane.fly(60.0)
    plane.mode = GUIDED
    plane.fly(2.9)
    assert plane.selected == [LOITER]
    plane.fly(5.0, setpoints=True)
    assert plane.mode == GUIDED
    plane.fly(3.2)
    assert plane.selected == [LOITER, LOITER]
    assert len(plane.texts) == 2


def test_a_mode_that_is_refused_is_asked_for_again_and_told_once():
    plane = Plane(mode=GUIDED)
    plane.state[b"refuses"] = True
    plane.fly(4.0)
    plane.state[b"refuses"] = False
    plane.fly(1.0)
    assert plane.mode == LOITER
    assert len(plane.selected) > 2
    assert len(plane.texts) == 1


@pytest.mark.parametrize(
    ("command", "component"),
    [(HEADING, GROUND_STATION), (mavlink.MAV_CMD_REQUEST_MESSAGE, COMPANION)],
)
def test_what_is_no_setpoint_of_the_companion_does_not_count(command, component):
    plane = Plane(mode=GUIDED)
    for _ in range(8):
        plane.hear(command, component)
        plane.fly(0.5)
    assert plane.selected == [LOITER]
