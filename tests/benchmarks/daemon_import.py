"""What the import of the companion's daemon costs, library by library: processor time and resident memory.

A process for each row; the least of five counts, since the first start compiles.
"""

import subprocess
import sys

from tests.benchmarks.results import Cases

ROWS = (
    ("Python alone", ""),
    ("asyncio, with the TLS library that it loads", "asyncio"),
    ("NumPy", "numpy"),
    ("pydantic", "pydantic, pydantic.json_schema, pydantic._internal._generate_schema"),
    ("pymavlink's dialect", "pymavlink.dialects.v20.ardupilotmega"),
    ("YAML, pymap3d, package metadata", "yaml, pymap3d, importlib.metadata"),
    ("the daemon's own modules", "vfguide.companion.daemon"),
)
"""What each row adds to the one above it."""

BESIDE = (
    ("with keys", "vfguide.companion.daemon, cryptography.hazmat.primitives.asymmetric.ed25519"),
    ("with a link of MQTT", "vfguide.companion.daemon, vfguide.link.mqtt"),
    ("`vfguide companion`, before it reads its mission", "vfguide.cli, vfguide.commands.companion"),
)
"""What is imported in addition by what the command line says."""

PROGRAM = """
import time
{imports}
used = time.process_time()
resident = next(line for line in open("/proc/self/status") if line.startswith("VmRSS:"))
print(used, resident.split()[1])
"""

TRIES = 5


def cost_of(modules: str) -> tuple[float, float]:
    """Processor time in s and resident memory in MB of a process that imports some modules."""
    program = PROGRAM.format(imports=f"import {modules}" if modules else "")
    found = [
        subprocess.check_output([sys.executable, "-c", program], text=True).split()
        for _ in range(TRIES)
    ]
    return min(float(used) for used, _ in found), min(float(size) for _, size in found) / 1024


def cases() -> Cases:
    """Tell first what each library adds, then what some starts take as a whole."""
    modules = list[str]()
    for name, more in ROWS:
        modules += [more] if more else []
        used_s, memory_mb = cost_of(", ".join(modules))
        yield name, {"used_s": used_s, "memory_mb": memory_mb}
    for name, imported in BESIDE:
        used_s, memory_mb = cost_of(imported)
        yield name, {"used_s": used_s, "memory_mb": memory_mb}
