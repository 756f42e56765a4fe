from sitl_stub import Autopilot, CalmWind, Signing
from tests.kit.companion import MANUAL, companion_of, emulator
from tests.kit.wire import heartbeat, packed
from vfguide.companion.supervisor import Mode
from vfguide.mavlink.framing import ConnectionSigning

KEY = bytes(range(32))
NOW_S = 1_800_000_000.0
STEP_S = 0.05


class Pair:
    """A leader's companion and its autopilot on a connection that the autopilot has signed."""

    def __init__(self, key: bytes | None) -> None:
        self.now = 0.0
        config = emulator(system_id=1, north=0.0, east=0.0).config
        signed = Signing(KEY)
        self.autopilot = Autopilot(
            config, CalmWind(), signing=signed, unix_time=lambda: NOW_S + self.now
        )
        signing = None if key is None else ConnectionSigning(key, lambda: NOW_S + self.now)
        self.companion = companion_of("leader", signing=signing)

    def fly(self, seconds: float, also: bytes = b"") -> None:
        replies = b""
        for _ in range(round(seconds / STEP_S)):
            telemetry = replies + self.autopilot.advance(self.now)
            out = self.companion.receive_mavlink(telemetry + also, self.now)
            replies = self.autopilot.receive(out.to_autopilot)
            self.now += STEP_S


def test_with_the_key_the_companion_is_obeyed_and_a_forged_heartbeat_takes_nothing_from_it():
    pair = Pair(KEY)
    pair.fly(30.0)
    assert pair.autopilot.truth().mode == "GUIDED"
    assert pair.companion.snapshot.mode is Mode.TRACKING
    assert pair.autopilot.counters["not signed"] == 0
    pair.fly(5.0, packed(heartbeat(MANUAL), system_id=1, component_id=1))
    assert pair.companion.snapshot.mode is Mode.TRACKING


def test_without_it_nothing_that_is_said_is_obeyed():
    pair = Pair(None)
    pair.fly(5.0)
    assert pair.autopilot.truth().mode == "LOITER"
    assert pair.autopilot.counters["not signed"] > 0
