"""Docker and whatever else is run beside the containers."""

import subprocess
from pathlib import Path

PROJECT = Path(__file__).parents[2]
COMPOSE_FILE = PROJECT / "docker-compose.yml"


def run(*command: str, check: bool = True, env: dict[str, str] | None = None) -> str:
    """What a command says; what it complains of, if it fails."""
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=1800, cwd=PROJECT, env=env
    )
    assert not check or done.returncode == 0, f"{' '.join(command)}: {done.stdout}{done.stderr}"
    return done.stdout


def log_of(container: str) -> str:
    """Standard output and standard error of a container, with Docker's times before each line."""
    command = ["docker", "logs", "--timestamps", container]
    return subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=True
    ).stdout
