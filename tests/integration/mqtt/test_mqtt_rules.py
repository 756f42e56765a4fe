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
async def test_the_broker_passes_on_the_consoles_orders_only_where_they_were_asked_for(
    guarded, orders, passed
):
    def topics(vehicle: str) -> Topics:
        return Topics(prefix="vfguide", formation="test", vehicle=vehicle)

    console, lead = topics("console"), topics("lead")
    own = {console.about_orders(kind) for kind in ORDERING}
    foreign = {lead.about_orders(Kind.ORDER), lead.state("lead")}

    broker = guarded("lead", "judge", "console", rules=rules_of(orders))

    def client(name: str) -> aiomqtt.Client:
        return aiomqtt.Client("127.0.0.1", broker.port, username=name, password="word")  # noqa: S106

    heard = set()
    async with client("judge") as judge, client("console") as sender, client("lead") as leader:
        await judge.subscribe("vfguide/#", qos=1)
        for topic in sorted(own | foreign):
            await sender.publish(topic, b"by the console", qos=1)
        await leader.publish(MARK, b"by the leader", qos=1)
        async with asyncio.timeout(60.0):
            async for message in judge.messages:
                if message.payload == b"by the leader":
                    break
                heard.add(message.topic.value)
    assert heard == (own if passed else set())
