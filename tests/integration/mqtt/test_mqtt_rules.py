"""A real mosquitto and the rules that the containers' broker is started with."""

import asyncio
import os
import subprocess
from pathlib import Path

import aiomqtt
import pytest

from vfguide.link.envelope import Kind
from vfguide.link.session import ORDERING, Topics

RULES = Path(__file__).parents[3] / "docker" / "bin" / "broker-rules"

MARK = "vfguide/test/lead/state"
"""What a vehicle publishes after the console: by then, what the console said was passed on or dropped."""


def rules_of(orders: str) -> str:
    """Those of a formation of two with a console, with or without CONSOLE_ORDERS=yes."""
    who = {"VEHICLES": "lead f1", "WATCHERS": "judge console", "ORDERS": orders}
    environment = {"PATH": os.environ["PATH"], **who}
    return subprocess.run(
        [RULES], env=environment, capture_output=True, text=True, check=True
    ).stdout


@pytest.mark.parametrize(("orders", "passed"), [("yes", True), ("", False)])
def test_the_broker_passes_on_the_consoles_orders_only_where_they_were_asked_for(
    mosquitto, password_file, tmp_path, orders, passed
):
    def topics(vehicle: str) -> Topics:
        return Topics(prefix="vfguide", formation="test", vehicle=vehicle)

    console, lead = topics("console"), topics("lead")
    own = {console.about_orders(kind) for kind in ORDERING}
    foreign = {lead.about_orders(Kind.ORDER), lead.state("lead")}

    async def scenario() -> set[str]:
        users = [password_file(name, "word").read_text() for name in ("lead", "judge", "console")]
        passwords, rules = tmp_path / "all-passwords", tmp_path / "rules"
        passwords.write_text("".join(users))
        rules.write_text(rules_of(orders))
        broker = mosquitto(
            f"allow_anonymous false\npassword_file {passwords}\nacl_file {rules}\n",
            basis="user root\n",
        )

        def client(name: str, word: str = "word") -> aiomqtt.Client:
            return aiomqtt.Client("127.0.0.1", broker.port, username=name, password=word)

        async with client("judge") as judge, client("console") as sender, client("lead") as leader:
            await judge.subscribe("vfguide/#", qos=1)
            for topic in sorted(own | foreign):
                await sender.publish(topic, b"by the console", qos=1)
            await leader.publish(MARK, b"by the leader", qos=1)
            heard = set()
            async for message in judge.messages:
                if message.payload == b"by the leader":
                    return heard
                heard.add(message.topic.value)
        raise AssertionError

    heard = asyncio.run(asyncio.wait_for(scenario(), 60.0))
    assert heard == (own if passed else set())
