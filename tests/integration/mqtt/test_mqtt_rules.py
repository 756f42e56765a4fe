"""A real mosquitto and the rules that the containers' broker is started with."""

import asyncio
import os
import subprocess
from pathlib import Path

import aiomqtt
import pytest

from vfguide.link.codec import Kind
from vfguide.link.member import Parcel
from vfguide.link.mqtt import ORDERING, Topics, level

RULES = Path(__file__).parents[3] / "docker" / "bin" / "broker-rules"

MARK = "vfguide/test/lead/state"
"""What a vehicle publishes after the console: by then, what the console said was passed on or dropped."""


def where(topics: Topics, kind: Kind) -> str:
    """Where a message to everybody goes."""
    return topics.of(Parcel(kind=kind, to="", data=b"", body=b""))


def rules_of(orders: str) -> str:
    """Those of a formation of two with a console, with or without CONSOLE_ORDERS=yes."""
    who = {"VEHICLES": "lead f1", "WATCHERS": "judge console", "ORDERS": orders}
    who["FORMATION"] = level("test")
    environment = {"PATH": os.environ["PATH"], **who}
    return subprocess.run(
        [RULES], env=environment, capture_output=True, text=True, check=True
    ).stdout


@pytest.mark.parametrize(("orders", "passed"), [("yes", True), ("", False), ("no", False)])
async def test_the_broker_passes_on_questions_of_the_console_and_orders_only_where_asked_for(
    guarded, orders, passed
):
    def topics(vehicle: str) -> Topics:
        return Topics(prefix="vfguide", formation="test", vehicle=vehicle)

    console, lead = topics("console"), topics("lead")
    own = {where(console, kind) for kind in (*ORDERING, Kind.REVOCATION)}
    questions = {console.ask(name) for name in ("lead", "f1")}
    foreign = {where(lead, Kind.ORDER), lead.state("lead")}

    broker = guarded("lead", "judge", "console", rules=rules_of(orders))

    def client(name: str) -> aiomqtt.Client:
        return aiomqtt.Client("127.0.0.1", broker.port, username=name, password="word")  # noqa: S106

    heard = set()
    async with client("judge") as judge, client("console") as sender, client("lead") as leader:
        await judge.subscribe("vfguide/#", qos=1)
        for topic in sorted(own | questions | foreign):
            await sender.publish(topic, b"by the console", qos=1)
        await leader.publish(MARK, b"by the leader", qos=1)
        async with asyncio.timeout(60.0):
            async for message in judge.messages:
                if message.payload == b"by the leader":
                    break
                heard.add(message.topic.value)
    assert heard == questions | (own if passed else set())


async def test_an_account_of_a_vehicle_stores_no_more_than_its_own_topics_hold(guarded):
    broker = guarded("f1", "judge", rules=rules_of(""))

    def client(name: str) -> aiomqtt.Client:
        return aiomqtt.Client("127.0.0.1", broker.port, username=name, password="word")  # noqa: S106

    own = Topics(prefix="vfguide", formation="test", vehicle="f1")
    wanted = {own.state("f1"), own.lead("f1"), own.presence("f1"), own.answer("lead")}
    wanted |= {where(own, kind) for kind in (*ORDERING, Kind.REVOCATION)} | {own.ask("lead")}
    made_up = {f"vfguide/test/f1/{number}" for number in range(50)}
    made_up |= {"vfguide/other/f1/state", "vfguide/test/lead/state", own.answer("nobody")}
    kept = set()
    async with client("f1") as sender, client("judge") as judge, asyncio.timeout(60.0):
        for topic in sorted(wanted | made_up):
            await sender.publish(topic, b"kept", qos=1, retain=True)
        await judge.subscribe("vfguide/#", qos=1)
        # All that was kept comes first.
        await sender.publish(own.state("f1"), b"the end", qos=1)
        async for message in judge.messages:
            if message.payload == b"the end":
                break
            kept.add(message.topic.value)
    assert kept == wanted
