"""Command line of the emulator."""

import asyncio
import difflib
import inspect
import logging
import signal
import sys
from collections.abc import Callable, Coroutine
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as version_of
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, NoReturn, cast, get_args, get_origin

import typer
import yaml

from sitl_stub.config import Option, OptionError, option_name, option_of
from sitl_stub.links import Address, AddressError, Emulated, LinkError
from sitl_stub.server import precise_event_loop, serve_all
from sitl_stub.settings import Settings, field_names

WRONG_INPUT, BROKEN = 2, 3

UsageError = cast("type[typer.BadParameter]", typer.BadParameter.__base__)
"""Base class of all usage errors; Typer exports only some of its subclasses."""

MOST_BYTES = 262_144

app = typer.Typer(
    name="sitl-stub",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

EXAMPLES = """\b
Examples:
  sitl-stub --system-id 1 --mavlink udpout://127.0.0.1:14550
  sitl-stub --system-id 1 --mavlink tcpin://0.0.0.0:5760 --autopilot px4 --airborne
  sitl-stub --system-id 1 --mavlink udpout://127.0.0.1:14551 --count 4 --airborne
  sitl-stub --config fleet.yaml --seed 2
"""


class ConfigError(ValueError):
    """Fault of a settings file, in one line with the remedy."""


def read_settings(file: Path) -> dict[str, object]:
    """Read the settings in a YAML file, by field name.

    Keys are fields as a mission spells them, such as `airspeed_range_m_s: [16, 32]`, or options without their
    dashes, such as `airspeed-range: "16,32"`. Repeatable options have a list.

    Raises:
        ConfigError: the file cannot be read, holds no settings, or holds an unknown one.
    """
    try:
        with file.open("rb") as stream:
            content = stream.read(MOST_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{file}: {error.strerror}; name a file of options") from error
    if len(content) > MOST_BYTES:
        raise ConfigError(f"{file}: larger than 256 KiB; this is no file of options")
    try:
        read = yaml.safe_load(content)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise ConfigError(f"{file}: this is no YAML; write lines such as alpha: 0.9") from error
    if not isinstance(read, dict):
        raise ConfigError(f"{file}: holds no options; write lines such as alpha: 0.9")
    known = field_names()
    settings: dict[str, object] = {}
    for key, value in read.items():
        if str(key) not in known:
            near = difflib.get_close_matches(str(key), known, n=1)
            hint = f"did you mean {near[0]}?" if near else "see sitl-stub --help"
            raise ConfigError(f"{file}: there is no option {key!r}; {hint}")
        settings[known[str(key)]] = value
    return settings


def given_options(context: typer.Context) -> dict[str, object]:
    """Return the values given on the command line, by field name."""
    sources = {field: context.get_parameter_source(field) for field in Settings.model_fields}
    return {
        field: context.params[field]
        for field, source in sources.items()
        if source is not None and source.name == "COMMANDLINE"
    }


def parameter_of(field: str) -> inspect.Parameter:
    """Return a field of the settings as an option of the command."""
    info, option = Settings.model_fields[field], option_of(Settings, field) or Option()
    default = None if info.is_required() else info.get_default(call_default_factory=True)
    # `float | None` becomes an option of type float.
    kinds = [one for one in get_args(info.annotation) if one is not NoneType]
    kind: Any = kinds[0] if len(kinds) == 1 else info.annotation
    if option.shown is not None:
        kind, default = str, option.shown
    elif default in ((), {}):
        kind, default = list[str] | None, None
    elif isinstance(default, tuple):
        kind, default = str, ",".join(str(one).removesuffix(".0") for one in default)
    elif kind not in {bool, int, float} and get_origin(kind) is not Literal:
        kind = str
    declared = typer.Option(
        f"--{option_name(Settings, field)}",
        help=" ".join((info.description or "").split()),
        metavar=option.metavar,
    )
    annotation: Any = kind if default is not None else kind | None
    where = inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(
        field, where, default=default, annotation=Annotated[annotation, declared]
    )


def tell_version(wanted: bool) -> None:
    """Print the version and exit, if asked for.

    Raises:
        typer.Exit: the version was asked for.
    """
    if wanted:
        sys.stdout.write(f"sitl-stub {own_version()}\n")
        raise typer.Exit


def own_version() -> str:
    """Return the version of vfguide, or of the emulator where it is installed alone."""
    try:
        return version_of("vfguide")
    except PackageNotFoundError:
        return version_of("sitl-stub")


def fly(
    context: typer.Context,
    *,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="YAML file of options, such as alpha: 0.9, or of a mission's fields, such as alpha_1_s: 0.9;"
            " options of the command line win.",
        ),
    ] = None,
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=tell_version, help="Print the version."),
    ] = False,
    **options: object,
) -> None:
    """Emulate autopilots with their fixed-wing aircraft, speaking MAVLink over UDP or TCP.

    One starts on the ground, or with --airborne in the air in a loiter. SIGTERM and Ctrl-C end it. Exit
    status: 0 ended as told, 2 the input is wrong, 3 it broke, such as when the port is taken.
    docs/emulator.md has more.
    """
    del version, options
    try:
        values = read_settings(config) if config is not None else {}
    except ConfigError as error:
        fail(f"--config {error}", WRONG_INPUT)
    try:
        settings = Settings.of({**values, **given_options(context)})
        emulated = settings.fleet()
    except ValueError as error:
        fail(error, WRONG_INPUT)

    def reboot_all() -> None:
        for one, _address in emulated:
            one.reboot()

    try:
        run(serve_all(emulated, settings, on_open=announce), reboot_all)
    except (AddressError, OptionError) as error:
        fail(error, WRONG_INPUT)
    except LinkError as error:
        fail(error, BROKEN)
    except OSError as error:
        fail(f"--truth: {error.strerror}", BROKEN)


def offer_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command an option for each field of the settings, before its own options."""
    signature = inspect.signature(command)
    own = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
    context, *own = own
    fields = [parameter_of(field) for field in Settings.model_fields]
    command.__signature__ = signature.replace(parameters=[context, *fields, *own])  # type: ignore[attr-defined]
    command.__annotations__ |= {one.name: one.annotation for one in fields}
    return command


app.command(epilog=EXAMPLES)(offer_settings(fly))


def announce(emulated: Emulated, address: Address) -> None:
    """Print a line with the system id and address of an emulator that has opened its link."""
    sys.stderr.write(f"sitl-stub: system {emulated.system_id} at {address}\n")
    sys.stderr.flush()


def run(service: Coroutine[None, None, None], on_hangup: Callable[[], None]) -> None:
    """Run a service until it ends or a signal ends it; SIGHUP calls `on_hangup`."""
    logging.basicConfig(format="sitl-stub: %(message)s", level=logging.INFO)
    with asyncio.Runner(loop_factory=precise_event_loop) as runner:
        runner.run(until_signalled(service, on_hangup))


def on_signal(name: str, do: Callable[[], object]) -> None:
    """Call `do` in the running loop at a signal, where the system has that signal."""
    loop, number = asyncio.get_running_loop(), getattr(signal, name, None)
    if number is None:
        return
    try:
        loop.add_signal_handler(number, do)
    except NotImplementedError:
        signal.signal(number, lambda *_: loop.call_soon_threadsafe(do))


async def until_signalled(
    service: Coroutine[None, None, None], on_hangup: Callable[[], None]
) -> None:
    """Run a service until it ends, or until SIGTERM or SIGINT cancels it without an error."""
    task = asyncio.ensure_future(service)
    on_signal("SIGTERM", task.cancel)
    on_signal("SIGINT", task.cancel)
    on_signal("SIGHUP", on_hangup)
    await asyncio.wait([task])
    if not task.cancelled():
        task.result()


def fail(fault: object, status: int) -> NoReturn:
    """Print the fault in one line and exit.

    Raises:
        typer.Exit: always, with the status.
    """
    sys.stderr.write(f"sitl-stub: {fault}\n")
    raise typer.Exit(status)


def main() -> None:
    """Run the command line, and report a wrong one in one line."""
    try:
        sys.exit(app(prog_name="sitl-stub", standalone_mode=False))
    except UsageError as error:
        text = error.format_message().rstrip(".")
        sys.stderr.write(f"sitl-stub: {text[:1].lower()}{text[1:]}; see sitl-stub -h\n")
        sys.exit(WRONG_INPUT)


if __name__ == "__main__":
    main()
