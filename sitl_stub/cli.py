"""The command line: options in, emulated autopilots on the air, exit status out."""

import asyncio
import logging
import signal
import sys
from collections.abc import Callable, Coroutine
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from sitl_stub.air import Turbulence
from sitl_stub.aircraft import SpeedResponse
from sitl_stub.bad_link import Emulated
from sitl_stub.fleet import (
    Aircraft,
    Errors,
    LinkQuality,
    Start,
    Telemetry,
    Weather,
    fleet_of,
)
from sitl_stub.links import Address, AddressError
from sitl_stub.option_file import OptionFileError, read_options
from sitl_stub.options import OptionError, checked, checked_epoch
from sitl_stub.sensor_errors import SensorGrade
from sitl_stub.server import LinkError, Service, precise_event_loop, serve_all

WRONG_INPUT, BROKEN = 2, 3

MAX_SPEEDUP = 1000.0

app = typer.Typer(
    name="sitl-stub",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

EXAMPLE = "Example: sitl-stub --system-id 1 --mavlink udpout://127.0.0.1:14550 --airborne"

START, FLIES, AIR = "How it starts", "How it flies", "What it flies in"
SAYS, LINK = "What it reports", "MAVLink and time"


def flag(name: str, text: str, group: str) -> typer.models.OptionInfo:
    """An option without a value, in its part of the help."""
    info: typer.models.OptionInfo = typer.Option(name, help=text, rich_help_panel=group)
    return info


def option(text: str, group: str, metavar: str | None = None) -> typer.models.OptionInfo:
    """An option of the command, in its part of the help."""
    info: typer.models.OptionInfo = typer.Option(help=text, metavar=metavar, rich_help_panel=group)
    return info


def take_options(context: typer.Context, file: Path | None) -> Path | None:
    """Take what the command line does not say from a file.

    Raises:
        typer.Exit: the file is wrong.
    """
    if file is not None and not context.resilient_parsing:
        known = {one.name for one in context.command.params if one.name} - {"config", "version"}
        try:
            context.default_map = read_options(file, known)
        except OptionFileError as error:
            fail(f"--config {error}", WRONG_INPUT)
    return file


def tell_version(wanted: bool) -> None:
    """Print the version and end.

    Raises:
        typer.Exit: if it was asked for.
    """
    if wanted:
        sys.stdout.write(f"sitl-stub {version_of('vfguide')}\n")
        raise typer.Exit


@app.command(epilog=EXAMPLE)
def fly(
    *,
    system_id: Annotated[int, option("MAVLink system id, 1 to 255.", LINK, "N")],
    mavlink: Annotated[
        str, option("udpin://, udpout://, tcpin:// or tcpout:// HOST:PORT.", LINK, "URL")
    ],
    count: Annotated[
        int, option("Aircraft in this process: system ids and ports count up.", LINK, "N")
    ] = 1,
    autopilot: Annotated[
        str, option("ardupilot, px4, or one of --plugin: as which it behaves.", FLIES, "NAME")
    ] = "ardupilot",
    autopilot_version: Annotated[
        str | None, option("Of px4, 1.14 to 1.18; default: the newest.", FLIES, "X.Y")
    ] = None,
    plant: Annotated[
        str | None,
        option(
            "heading-hold: first order, the wind drifts it; course-hold: the article's model; bank:"
            " bank from course error, as ArduPlane's GUIDED; npfg: as PX4's course; six-dof: a rigid body;"
            " or one of --plugin. Default: heading-hold; with px4 npfg, with all that was measured on it.",
            FLIES,
            "NAME",
        ),
    ] = None,
    plant_option: Annotated[
        list[str] | None, option("A number of a plant of one's own.", FLIES, "NAME=VALUE")
    ] = None,
    plugin: Annotated[
        list[Path] | None,
        option("A file of Python with a plant or an autopilot of your own.", FLIES, "FILE"),
    ] = None,
    alpha: Annotated[
        float | None,
        option("Gain of the course or heading hold, 1/s; default 1.2, PX4's own 0.88.", FLIES, "A"),
    ] = None,
    beta: Annotated[float, option("Gain of the speed hold, 1/s.", FLIES, "B")] = 0.8,
    speed_response: Annotated[
        SpeedResponse | None,
        option(
            "tecs: as ArduPlane, late and slow to settle; px4: slews and swings; px4-untrimmed: as it comes,"
            " creeps. Default: first-order, PX4's own px4-untrimmed.",
            FLIES,
        ),
    ] = None,
    guided_p: Annotated[
        float, option("With bank: bank per course error, 0.01 deg/rad.", FLIES, "P")
    ] = 12_000.0,
    roll_time: Annotated[float, option("With bank: time constant of the roll.", FLIES, "S")] = 0.4,
    roll_delay: Annotated[
        float | None,
        option(
            "With bank: that of the bank on its way there; default 0, PX4's own 0.2.", FLIES, "S"
        ),
    ] = None,
    turn_efficiency: Annotated[
        float, option("With bank: parts of the coordinated turn.", FLIES, "X")
    ] = 1.0,
    course_dead_time: Annotated[
        float | None,
        option("Until a new course reaches its loop; default 0, PX4's own 0.06.", FLIES, "S"),
    ] = None,
    speed_dead_time: Annotated[
        float | None, option("The same for a speed; default 0, with tecs 0.5.", FLIES, "S")
    ] = None,
    airspeed_range: Annotated[str, option("What it can fly, m/s.", FLIES, "LO,HI")] = "12,32",
    max_bank: Annotated[
        float | None, option("Limit of the bank; default 45, with px4 50.", FLIES, "DEG")
    ] = None,
    max_acceleration: Annotated[
        float, option("Limit of the rate of change of speed, m/s2.", FLIES, "A")
    ] = 3.0,
    climb_range: Annotated[
        str, option("Fastest sink, negative, and climb, m/s.", FLIES, "LO,HI")
    ] = "-3,3",
    height_delay: Annotated[
        float, option("How far the height is behind one that climbs.", FLIES, "S")
    ] = 2.0,
    wind: Annotated[str, option("calm, article or steady:SPEED,TOWARD_DEG.", AIR, "WIND")] = "calm",
    turbulence: Annotated[
        Turbulence, option("Dryden's, by MIL-F-8785C; shared by all of one seed.", AIR)
    ] = "none",
    air_height: Annotated[
        float, option("Above the ground, for which wind and turbulence are meant.", AIR, "M")
    ] = 100.0,
    gust: Annotated[
        list[str] | None,
        option("One minus cosine: seconds, m/s. Repeatable.", AIR, "AT,FOR,N,E"),
    ] = None,
    roughness: Annotated[
        float | None,
        option("Of the ground, above 0 to 0.5: the wind then grows with height.", AIR, "M"),
    ] = None,
    start: Annotated[
        str,
        option("Degrees, metres above mean sea level, degrees.", START, "LAT,LON,ALT,COURSE"),
    ] = "47.397742,8.545594,588,0",
    airborne: Annotated[
        bool,
        flag("--airborne", "Start in the air; else on the ground, disarmed, at ALT.", START),
    ] = False,
    airspeed: Annotated[float, option("In the air, where none is commanded.", START, "M_S")] = 20.0,
    home_altitude: Annotated[
        float | None,
        option("Of the ground below the start; default: 100 m below it.", START, "M"),
    ] = None,
    spacing: Annotated[
        float, option("With --count: from one start to the next, to the right.", START, "M")
    ] = 30.0,
    ready_after: Annotated[
        float, option("Until sensors have settled and it can be armed.", START, "S")
    ] = 0.0,
    route: Annotated[
        str | None,
        option("Fly this by itself; round, if it ends where it begins.", START, "LAT,LON;…"),
    ] = None,
    position_noise: Annotated[
        float, option("Standard deviation of reported positions.", SAYS, "M")
    ] = 0.0,
    velocity_noise: Annotated[
        float, option("The same of velocities over ground.", SAYS, "M_S")
    ] = 0.0,
    heading_noise: Annotated[float, option("The same of headings.", SAYS, "DEG")] = 0.0,
    airspeed_noise: Annotated[float, option("The same of airspeeds.", SAYS, "M_S")] = 0.0,
    sensors: Annotated[
        SensorGrade, option("GNSS of this grade, and other sensors like real ones.", SAYS)
    ] = "ideal",
    gps_glitch: Annotated[
        list[str] | None,
        option("Positions off for a time: seconds, metres. Repeatable.", SAYS, "AT,FOR,N,E"),
    ] = None,
    indicated_airspeed: Annotated[
        bool, flag("--indicated-airspeed", "Airspeeds on the wire are not the true ones.", SAYS)
    ] = False,
    airspeed_calibration: Annotated[
        float, option("Shown airspeed in parts of the right one.", SAYS, "X")
    ] = 1.0,
    loop_rate: Annotated[
        float | None,
        option("Telemetry leaves on this scheduler's ticks only; default: on time.", SAYS, "HZ"),
    ] = None,
    old_parameter_names: Annotated[
        bool,
        flag("--old-parameter-names", "ArduPlane's before 4.5, such as ARSPD_FBW_MIN.", SAYS),
    ] = False,
    stream: Annotated[
        list[str] | None,
        option("Send this unasked instead of the autopilot's own. Repeatable.", SAYS, "NAME:HZ"),
    ] = None,
    icao_address: Annotated[int, option("Of its transponder, for ADSB_VEHICLE.", SAYS, "N")] = 0,
    boot_time: Annotated[float, option("What its clock shows at the start.", SAYS, "S")] = 0.0,
    also_to: Annotated[
        list[str] | None,
        option("udpout:// address that hears it, too. Repeatable; not with --count.", LINK, "URL"),
    ] = None,
    delay: Annotated[float, option("Each way, of every datagram.", LINK, "S")] = 0.0,
    jitter: Annotated[float, option("More or less than the delay.", LINK, "S")] = 0.0,
    loss: Annotated[float, option("Share of datagrams lost, each way.", LINK, "P")] = 0.0,
    signing_key: Annotated[
        str | None,
        option("Sign and hear only what is signed: 64 hex digits, or a passphrase.", LINK, "KEY"),
    ] = None,
    speedup: Annotated[float, option("Seconds of simulation in one real second.", LINK, "X")] = 1.0,
    seed: Annotated[int, option("Of everything random.", LINK, "N")] = 0,
    truth: Annotated[
        str | None,
        option("True states as JSON lines: udpout://HOST:PORT or a file.", LINK, "TO"),
    ] = None,
    truth_rate: Annotated[
        float, option("True states in a second of simulation.", LINK, "HZ")
    ] = 20.0,
    duration: Annotated[
        float | None, option("Simulation time at which it ends.", LINK, "S")
    ] = None,
    epoch: Annotated[
        float | None,
        option(
            "Unix time of simulation time zero, the same for a whole formation; default: now.",
            LINK,
            "SECONDS",
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            is_eager=True,
            callback=take_options,
            help="YAML with options, such as alpha: 0.9; those of the command line go before it.",
        ),
    ] = None,
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=tell_version, help="Tell the version."),
    ] = False,
) -> None:
    """Emulate autopilots with their fixed-wing aircraft, speaking MAVLink over UDP or TCP.

    One starts on the ground, or with --airborne in the air in a loiter. SIGTERM and Ctrl-C end it. Exit
    status: 0 ended as told, 2 the input is wrong, 3 it broke, such as when the port is taken.
    docs/emulator.md has more.
    """
    del config, version
    try:
        emulated = fleet_of(
            system_id=system_id,
            url=mavlink,
            count=count,
            seed=int(checked("--seed", seed, -1, 2**63)),
            signing_key=signing_key,
            aircraft=Aircraft(
                autopilot=autopilot,
                autopilot_version=autopilot_version,
                plant=plant,
                alpha_1_s=alpha,
                beta_1_s=beta,
                speed_response=speed_response,
                guided_p=guided_p,
                roll_time_s=roll_time,
                roll_delay_s=roll_delay,
                turn_efficiency=turn_efficiency,
                course_dead_time_s=course_dead_time,
                speed_dead_time_s=speed_dead_time,
                airspeed_range=airspeed_range,
                max_bank_deg=max_bank,
                max_acceleration_m_s2=max_acceleration,
                climb_range=climb_range,
                height_delay_s=height_delay,
                options=tuple(plant_option or ()),
                plugins=tuple(plugin or ()),
            ),
            weather=Weather(
                wind=wind,
                turbulence=turbulence,
                height_m=air_height,
                gusts=tuple(gust or ()),
                roughness_m=roughness,
            ),
            start=Start(
                where=start,
                airborne=airborne,
                airspeed_m_s=airspeed,
                home_altitude_m=home_altitude,
                spacing_m=spacing,
                ready_after_s=ready_after,
                route=route,
            ),
            errors=Errors(
                position_m=position_noise,
                velocity_m_s=velocity_noise,
                heading_deg=heading_noise,
                airspeed_m_s=airspeed_noise,
                sensors=sensors,
                gps_glitches=tuple(gps_glitch or ()),
            ),
            telemetry=Telemetry(
                indicated_airspeed=indicated_airspeed,
                airspeed_calibration=airspeed_calibration,
                loop_rate_hz=loop_rate,
                old_parameter_names=old_parameter_names,
                streams=tuple(stream or ()),
                icao_address=int(checked("--icao-address", icao_address, -1, 2**24)),
                boot_time_s=checked("--boot-time", boot_time, -1.0, 1e9),
            ),
            quality=LinkQuality(delay_s=delay, jitter_s=jitter, loss=loss),
        )
        service = Service(
            speedup=checked("--speedup", speedup, 0.0, MAX_SPEEDUP),
            epoch_s=None if epoch is None else checked_epoch(epoch, speedup),
            truth_url=truth,
            truth_rate_hz=truth_rate,
            duration_s=duration,
            also_to=tuple(also_to or ()),
        )
    except ValueError as error:
        fail(error, WRONG_INPUT)

    def reboot_all() -> None:
        for one, _address in emulated:
            one.reboot()

    try:
        run(serve_all(emulated, service, on_open=announce), reboot_all)
    except (AddressError, OptionError) as error:
        fail(error, WRONG_INPUT)
    except LinkError as error:
        fail(error, BROKEN)
    except OSError as error:
        fail(f"--truth: {error.strerror}", BROKEN)


def announce(emulated: Emulated, address: Address) -> None:
    """One line that says that it is on the air, and on which port."""
    sys.stderr.write(f"sitl-stub: system {emulated.system_id} at {address}\n")
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
