"""A real PX4 answers as the table says, by which the emulator is tested, too."""

import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.autopilots.conftest import program
from tests.autopilots.ground_station import GroundStation
from tests.autopilots.px4_manners import CAPABILITIES, MANNERS, PARAMETERS, VERSION, Manner
from tests.autopilots.simulators import CLIMB_S, Conditions, Place, Px4, free_instances

HEIGHT_M, PATIENCE_S = 60.0, 20.0


@pytest.fixture
def station(tmp_path: Path) -> Iterator[GroundStation]:
    """The ground station of one PX4 that loiters."""
    instance = free_instances(Px4, 1)
    simulator = Px4(
        program("px4"),
        tmp_path,
        name="px4",
        system_id=instance + 1,
        instance=instance,
        place=Place(latitude_deg=47.397742, longitude_deg=8.545594, altitude_amsl_m=0.0),
        height_m=HEIGHT_M,
        conditions=Conditions(factory=True),
    )
    simulator.program.start()
    try:
        found = simulator.station
        simulator.take_off()
        found.wait(lambda: found.altitude_amsl_m > 0.8 * HEIGHT_M, "not up", CLIMB_S)
        simulator.enter("LOITER")
        yield found
    finally:
        simulator.close()


def answer(station: GroundStation, manner: Manner) -> int:
    """What a command is answered with."""
    station.command(manner.command, *manner.parameters)
    station.wait(lambda: manner.command in station.results, manner.what, PATIENCE_S)
    return station.results[manner.command]


def test_a_real_px4_has_the_manners_that_are_emulated(station: GroundStation) -> None:
    answered = {manner.what: answer(station, manner) for manner in MANNERS}
    assert answered == {manner.what: manner.result for manner in MANNERS}
    station.wait(lambda: station.version, "no version", PATIENCE_S, station.ask_for_version)
    assert station.version == (VERSION, CAPABILITIES)
    for name in PARAMETERS:
        station.wait(
            lambda name=name: name in station.parameters,  # type: ignore[misc]
            name,
            PATIENCE_S,
            lambda name=name: station.ask_for_parameter(name),  # type: ignore[misc]
        )
    whole = {
        name: struct.unpack("<i", struct.pack("<f", station.parameters[name]))[0]
        for name in PARAMETERS
    }
    assert whole == dict(PARAMETERS)
