"""The console in containers only looks on unless it is asked to give orders; then the broker lets it."""

import os
import subprocess
from typing import Any

import pytest
import yaml

from tests.kit.missions import ROOT

BIN = ROOT / "docker" / "bin"


@pytest.fixture(scope="module")
def services() -> dict[str, Any]:
    """All services of docker-compose.yml, by name."""
    return yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))["services"]


def run(script: str, path: str, **environment: str) -> str:
    """What a script of a container prints."""
    done = subprocess.run(
        ["/bin/sh", str(BIN / script)],
        env={"PATH": path, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=60.0,
    )
    return done.stdout


def writes(rules: str, user: str) -> list[str]:
    """Topics that a user may write, by the broker's rules."""
    found, current = [], ""
    for line in rules.splitlines():
        word, _, rest = line.partition(" ")
        if word == "user":
            current = rest
        elif rest.startswith("write ") and current == user:
            found.append(rest.removeprefix("write "))
    return found


def test_docker_compose_up_serves_the_console_beside_the_demonstration(services):
    settings = (ROOT / ".env").read_text(encoding="utf-8").splitlines()
    assert "COMPOSE_PROFILES=demo,console" in settings
    assert services["console"]["profiles"] == ["console"]
    # All that it waits for is there in the demonstration.
    for name in services["console"]["depends_on"]:
        assert "demo" in services[name]["profiles"]


def test_one_setting_asks_for_orders_and_is_off_unless_set(services):
    assert services["console"]["environment"]["ORDERS"] == "${CONSOLE_ORDERS:-}"
    assert services["broker"]["environment"]["ORDERS"] == "${CONSOLE_ORDERS:-}"
    assert services["console"]["environment"]["VEHICLE"] == "console"
    assert "console" in services["keys"]["environment"]["OPERATORS"].split()


@pytest.mark.parametrize(
    ("asked", "orders"), [("", []), ("no", []), ("yes", ["order", "repeat", "reply"])]
)
def test_who_watches_writes_its_questions_and_an_operator_below_its_own_name(asked, orders):
    rules = run(
        "broker-rules",
        os.environ["PATH"],
        FORMATION="a%20b",
        VEHICLES="leader f1",
        WATCHERS="judge console",
        ORDERS=asked,
    )
    questions = [f"vfguide/a%20b/{vehicle}/clock/ask" for vehicle in ("leader", "f1")]
    own = [f"vfguide/a%20b/console/{order}" for order in orders]
    assert writes(rules, "console") == [*(f"{one}/console" for one in questions), *own]
    assert writes(rules, "judge") == [f"{one}/judge" for one in questions]
    assert "vfguide/a%20b/f1/state" in writes(rules, "f1")
    assert not [topic for topic in writes(rules, "f1") if "#" in topic or "+" in topic]
    assert {topic.split("/")[2] for topic in writes(rules, "f1")} == {"leader", "f1"}


@pytest.mark.parametrize(("orders", "given"), [("", False), ("no", False), ("yes", True)])
def test_the_console_is_started_with_operator_only_where_orders_are_asked_for(
    tmp_path, orders, given
):
    vfguide = tmp_path / "vfguide"
    vfguide.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    vfguide.chmod(0o755)
    (tmp_path / "link-options").write_text("LINK=mqtts://console@broker\n")
    said = run(
        "run-console",
        f"{tmp_path}:{os.environ['PATH']}",
        VEHICLE="console",
        BROKER="broker",
        PUBLISHED="8080",
        ORDERS=orders,
    )
    assert ("--operator" in said.split()) is given
    assert "http://127.0.0.1:8080" in said.split()
