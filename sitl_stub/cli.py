"""The command line: options in, one emulated autopilot on the air, exit status out."""

import asyncio
import logging
import math
import signal
import sys
import time
from collections.abc import Callable, Coroutine
from typing import Annotated, Literal, NoReturn

import typer

from sitl_stub.address import Address, AddressError, parse_address
from sitl_stub.aircraft import PlantParameters
from sitl_stub.autopilot import Autopilot
from sitl_stub.config import AutopilotConfig
from sitl_stub.options import OptionError, checked, parse_numbers, parse_wind
from sitl_stub.server import LinkError, precise_event_loop, serve

WRONG_INPUT, BROKEN = 2, 3

MAX_SPEEDUP = 1000.0
MAX_EPOCH_AWAY_S = 3600.0
"""How far from now simulation time zero may lie, in seconds of simulation."""

DEFAULT_HEIGHT_M = 100.0
"""Start above home, where home's altitude is not given."""

app = typer.Typer(
    name="sitl-stub",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.command()
def fly(
    *,
    system_id: Annotated[int, typer.Option(metavar="N", help="MAVLink system id, 1 to 255.")],
    mavlink: Annotated[
        str,
        typer.Option(metavar="URL", help="udpin://, udpout://, tcpin:// or tcpout:// HOST:PORT."),
    ],
    autopilot: Annotated[
        Literal["ardupilot", "px4"], typer.Option(help="Whose manners it has.")
    ] = "ardupilot",
    plant: Annotated[
        Literal["course-hold", "heading-hold"],
        typer.Option(help="heading-hold: the wind drifts it; course-hold: the article's model."),
    ] = "heading-hold",
    alpha: Annotated[
        float, typer.Option(metavar="A", help="Gain of the course or heading hold, 1/s.")
    ] = 1.2,
    beta: Annotated[float, typer.Option(metavar="B", help="Gain of the speed hold, 1/s.")] = 0.8,
    wind: Annotated[
        str, typer.Option(metavar="WIND", help="calm, article or steady:SPEED,TOWARD_DEG.")
    ] = "calm",
    start: Annotated[
        str,
        typer.Option(
            metavar="LAT,LON,ALT,COURSE", help="Degrees, metres above mean sea level, degrees."
        ),
    ] = "47.397742,8.545594,588,0",
    airborne: Annotated[
        bool,
        typer.Option(
            "--airborne",
            help="Start in the air. So far it always does: a start on the ground is not emulated.",
        ),
    ] = False,
    airspeed: Annotated[
        float, typer.Option(metavar="M_S", help="At the start, and when none is commanded.")
    ] = 20.0,
    airspeed_range: Annotated[
        str, typer.Option(metavar="LO,HI", help="What it can fly, m/s.")
    ] = "12,32",
    max_bank: Annotated[float, typer.Option(metavar="DEG", help="Limit of the bank.")] = 45.0,
    home_altitude: Annotated[
        float | None,
        typer.Option(metavar="M", help="Of the ground below the start; default: 100 m below it."),
    ] = None,
    position_noise: Annotated[
        float, typer.Option(metavar="M", help="Standard deviation of reported positions.")
    ] = 0.0,
    speedup: Annotated[
        float, typer.Option(metavar="X", help="Seconds of simulation in one real second.")
    ] = 1.0,
    seed: Annotated[int, typer.Option(metavar="N", help="Of the noise.")] = 0,
    truth: Annotated[
        str | None,
        typer.Option(metavar="TO", help="True states as JSON lines: udpout://HOST:PORT or a file."),
    ] = None,
    truth_rate: Annotated[
        float, typer.Option(metavar="HZ", help="True states in a second of simulation.")
    ] = 20.0,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Simulation time at which it ends.")
    ] = None,
    epoch: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Unix time of simulation time zero, the same for a whole formation; default: now.",
        ),
    ] = None,
) -> None:
    """Emulate one autopilot with its fixed-wing aircraft, speaking MAVLink over UDP or TCP.

    It starts in the air, in a loiter. SIGTERM and Ctrl-C end it. Exit status: 0 ended as told, 2 the
    input is wrong, 3 it broke, such as when the port is taken.
    """
    del airborne  # there is no other start yet
    try:
        address = parse_address(mavlink)
        latitude_deg, longitude_deg, altitude_m, course_deg = parse_numbers(
            "--start", start, "LAT,LON,ALT,COURSE"
        )
        config = AutopilotConfig(
            system_id=system_id,
            autopilot=autopilot,
            plant=plant_parameters(plant, alpha, beta, airspeed_range, max_bank),
            airspeed_m_s=airspeed,
            position_noise_m=position_noise,
            seed=int(checked("--seed", seed, -1, 2**63)),
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_amsl_m=altitude_m,
            home_altitude_amsl_m=(
                altitude_m - DEFAULT_HEIGHT_M if home_altitude is None else home_altitude
            ),
            course_rad=math.radians(course_deg),
        )
        emulated = Autopilot(config, parse_wind(wind))
        service = serve(
            emulated,
            address,
            speedup=checked("--speedup", speedup, 0.0, MAX_SPEEDUP),
            epoch_s=None if epoch is None else checked_epoch(epoch, speedup),
            truth_url=truth,
            truth_rate_hz=truth_rate,
            duration_s=duration,
            on_open=lambda opened: announce(system_id, opened),
        )
    except ValueError as error:
        fail(error, WRONG_INPUT)
    try:
        run(service, emulated.reboot)
    except (AddressError, OptionError) as error:
        fail(error, WRONG_INPUT)
    except LinkError as error:
        fail(error, BROKEN)
    except OSError as error:
        fail(f"--truth: {error.strerror}", BROKEN)


def plant_parameters(
    kind: Literal["course-hold", "heading-hold"],
    alpha_1_s: float,
    beta_1_s: float,
    airspeed_range: str,
    max_bank_deg: float,
) -> PlantParameters:
    """The aircraft that the options describe.

    Raises:
        ValueError: they describe none; the message is one line.
    """
    slowest_m_s, fastest_m_s = parse_numbers("--airspeed-range", airspeed_range, "LO,HI")
    if not 0.0 < max_bank_deg < 90.0:
        raise OptionError(f"--max-bank: {max_bank_deg:g} is not between 0 and 90")
    return PlantParameters(
        kind=kind,
        alpha_1_s=alpha_1_s,
        beta_1_s=beta_1_s,
        airspeed_min_m_s=slowest_m_s,
        airspeed_max_m_s=fastest_m_s,
        max_bank_rad=math.radians(max_bank_deg),
    )


def checked_epoch(epoch_s: float, speedup: float) -> float:
    """The Unix time of simulation time zero, if it is a time the aircraft can catch up with.

    Raises:
        OptionError: it is too far from now.
    """
    if not abs(time.time() - epoch_s) * speedup <= MAX_EPOCH_AWAY_S:
        raise OptionError(
            f"--epoch: {epoch_s:.0f} is more than {MAX_EPOCH_AWAY_S:.0f} s of simulation from now"
            f" ({time.time():.0f})"
        )
    return epoch_s


def announce(system_id: int, address: Address) -> None:
    """One line that says that it is on the air, and on which port."""
    sys.stderr.write(f"sitl-stub: system {system_id} at {address}\n")
    sys.stderr.flush()


def run(service: Coroutine[None, None, None], on_hangup: Callable[[], None]) -> None:
    """Run it until it ends or a signal ends it; SIGHUP is the autopilot's reset button."""
    logging.basicConfig(format="sitl-stub: %(message)s", level=logging.INFO)
    with asyncio.Runner(loop_factory=precise_event_loop) as runner:
        runner.run(until_signalled(service, on_hangup))


async def until_signalled(
    service: Coroutine[None, None, None], on_hangup: Callable[[], None]
) -> None:
    """Run it; SIGTERM and SIGINT cancel it, and that is no error."""
    task = asyncio.ensure_future(service)
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, task.cancel)
    asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, on_hangup)
    await asyncio.wait([task])
    if not task.cancelled():
        task.result()


def fail(fault: object, status: int) -> NoReturn:
    """Say in one line what was wrong, and exit.

    Raises:
        typer.Exit: with the status.
    """
    sys.stderr.write(f"sitl-stub: {fault}\n")
    raise typer.Exit(status)


def main() -> None:
    """Entry point."""
    app()


if __name__ == "__main__":
    main()
