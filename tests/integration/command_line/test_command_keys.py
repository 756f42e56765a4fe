"""`vfguide keys` makes, shows and rotates keys, and refuses private files that other users can read."""

import json
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.rsa import generate_private_key
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from tests.integration.command_line.conftest import PAIR
from tests.kit.programs import running, vfguide
from tests.kit.sockets import free_port
from vfguide.errors import InputError
from vfguide.flights import load_mission
from vfguide.flights import order as vfguide_order
from vfguide.link.keys import (
    key_places,
    public_bytes,
    read_private_key,
    read_radio_key,
    read_roster,
)

Make = Callable[..., Any]

COMPANION = ("--mavlink=udpin://127.0.0.1:14999", "--link=mqtt://127.0.0.1:1")
RADIO = "--link=serial:///dev/ttyNONE:57600"


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    """A leader and a follower."""
    file = tmp_path / "pair.yaml"
    file.write_text(PAIR)
    return file


@pytest.fixture
def keyed(command: Make, mission: Path) -> Path:
    """The same with keys."""
    assert command("keys", "make", mission).status == 0
    return mission


@pytest.fixture
def refused(refusal: Make, mission: Path) -> Make:
    """What the companion of the follower says that refuses to start."""
    return lambda *options: refusal("companion", "wing", "--mission", mission, *options)


@pytest.fixture
def refused_by_radio(command: Make, mission: Path) -> Make:
    """The last thing that it says of a link by radio, after what it says of radios."""

    def refuse(*options: object) -> str:
        outcome = command("companion", "wing", "--mission", mission, COMPANION[0], *options)
        assert outcome.status == 2
        last: str = outcome.lines[-1]
        return last

    return refuse


@pytest.mark.parametrize("keys", ["", ".", "/"])
def test_an_order_of_a_program_takes_its_keys_from_beside_a_file(mission, monkeypatch, keys):
    monkeypatch.chdir(mission.parent)
    with pytest.raises(InputError, match="is no file; name the mission file"):
        vfguide_order(load_mission(mission), "vee", links=["mqtt://127.0.0.1:1"], keys=keys)


def test_keys_are_made_for_everybody_and_nobody_else_may_read_them(command, mission):
    outcome = command("keys", "make", mission)
    assert outcome.status == 0
    assert outcome.out.count("new private key") == 3
    places = key_places(mission)
    roster = read_roster(places.roster)
    assert roster.formation == "pair"
    assert list(roster.vehicles) == ["lead", "wing"]
    assert list(roster.operators) == ["operator"]
    for name in ("lead", "wing", "operator"):
        path = places.private(name)
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert public_bytes(read_private_key(path)) == roster.public(name)
    assert stat.S_IMODE(places.directory.stat().st_mode) == 0o700


def test_to_make_keys_again_changes_nothing_and_a_new_vehicle_gets_one(command, keyed):
    before = key_places(keyed).roster.read_text()
    assert "nothing was changed" in command("keys", "make", keyed).out
    assert key_places(keyed).roster.read_text() == before
    tail = "  - {vehicle: tail, slot: {forward_m: -40, right_m: 0}}\n"
    text = keyed.read_text().replace("vehicles:\n", f"{tail}vehicles:\n", 1)
    keyed.write_text(text.replace("rehearsal:\n", "  tail: {system_id: 3}\nrehearsal:\n"))
    outcome = command("keys", "make", keyed)
    assert outcome.out.count("new private key") == 1
    assert "for tail alone" in outcome.out


def test_a_key_that_is_rotated_replaces_one_and_no_other(command, refusal, keyed):
    before = read_roster(key_places(keyed).roster)
    outcome = command("keys", "rotate", keyed, "wing")
    assert outcome.status == 0
    after = read_roster(key_places(keyed).roster)
    assert after.vehicles["wing"] != before.vehicles["wing"]
    assert after.vehicles["lead"] == before.vehicles["lead"]
    assert after.operators == before.operators
    assert command("keys", "rotate", keyed).out.count("new private key") == 3
    line = refusal("keys", "rotate", keyed, "nobody")
    assert line == "nobody is not a member of pair; its members are lead, wing, operator"


async def test_a_companion_keeps_that_a_key_is_revoked_over_a_restart_and_says_so(keyed, tmp_path):
    here, there = free_port(), free_port()
    link = f"--link=udp://127.0.0.1:{there}?port={here}"
    words = ("companion", "wing", "--mission", keyed, "--state", tmp_path, link)
    words = (*words, f"--mavlink=udpin://127.0.0.1:{free_port()}")
    theirs = f"--link=udp://127.0.0.1:{here}?port={there}"
    async with running("vfguide", *words):
        revoked = await vfguide("keys", "revoke", keyed, "lead", theirs)
    assert revoked.status == 0
    assert "the key of lead is revoked: 1 of 1 others know" in revoked.out
    async with running("vfguide", *words):
        shown = await vfguide("status", keyed, theirs, "--json")
    assert '"revoked_lead": 1.0' in shown.out
    # It is of that key alone.
    assert (await vfguide("keys", "rotate", keyed, "lead")).status == 0
    async with running("vfguide", *words):
        shown = await vfguide("status", keyed, theirs, "--json")
    assert '"online"' in shown.out
    assert "revoked_lead" not in shown.out


def test_nobody_without_an_operators_key_revokes_one(refusal, keyed):
    key_places(keyed).private("operator").unlink()
    line = refusal("keys", "revoke", keyed, "wing", COMPANION[1])
    assert line == "a key is revoked by an operator: give an operator's private key with --key"
    key_places(keyed).roster.unlink()
    line = refusal("keys", "revoke", keyed, "wing", COMPANION[1])
    assert line.endswith("there is no roster; make keys with `vfguide keys make MISSION`")


def test_who_has_which_key_is_shown_and_what_is_wrong_with_it(command, keyed):
    places = key_places(keyed)
    places.private("wing").chmod(0o644)
    places.private("operator").unlink()
    outcome = command("keys", "show", keyed, "--json")
    assert outcome.status == 0
    shown = json.loads(outcome.out)
    assert [shown[name]["role"] for name in shown] == ["leader", "follower", "operator"]
    assert shown["lead"]["private"] == "yes"
    assert shown["wing"]["private"].startswith("others may read this private key")
    assert shown["operator"]["private"] == "no"
    assert len(shown["lead"]["fingerprint"]) == 19
    assert command("keys", "show", keyed).status == 0


def test_a_companion_without_a_key_says_how_to_make_one(refused, mission):
    line = refused(*COMPANION)
    assert line == (
        f"{mission.with_suffix('.keys')}/wing.key: there is no private key of 'wing'; make keys with"
        " `vfguide keys make MISSION`, or type --insecure to believe anybody"
    )


def test_a_private_key_that_others_may_read_is_refused(refused, keyed):
    path = key_places(keyed).private("wing")
    path.chmod(0o640)
    line = refused(*COMPANION)
    assert line == f"{path}: others may read this private key; run: chmod 600 {path}"


def test_one_radio_key_is_made_for_all_and_replaced_when_any_key_is(command, keyed):
    path = key_places(keyed).radio
    before = read_radio_key(path)
    assert len(before) == 32
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert "nothing was changed" in command("keys", "make", keyed).out
    assert read_radio_key(path) == before
    outcome = command("keys", "rotate", keyed, "wing")
    assert f"{path}: new radio key, the same for all members" in " ".join(outcome.out.split())
    assert read_radio_key(path) != before


@pytest.mark.parametrize(
    ("content", "mode", "fault"),
    [
        ("0" * 64, 0o644, "others may read this radio key; run: chmod 600"),
        ("0" * 62, 0o600, "is no radio key of 64 hexadecimal digits"),
        ("no key", 0o600, "is no radio key of 64 hexadecimal digits"),
    ],
)
def test_a_radio_key_that_cannot_be_used_is_one_line(refused_by_radio, keyed, content, mode, fault):
    path = key_places(keyed).radio
    path.write_text(content)
    path.chmod(mode)
    assert fault in refused_by_radio(f"{RADIO}?key={path}")


def test_a_radio_without_its_key_says_how_to_make_one(refused_by_radio, keyed):
    line = refused_by_radio(RADIO)
    assert "a radio needs the formation's radio key" in line
    assert "vfguide keys make" in line
    insecure = (f"{RADIO}?key={key_places(keyed).radio}", "--insecure")
    assert "leave key= out" in refused_by_radio(*insecure)


def test_what_systemd_hands_over_counts_as_kept(keyed):
    """Its access list shows as permissions of the group."""
    path = key_places(keyed).private("wing")
    path.chmod(0o440)
    read_private_key(path, {"CREDENTIALS_DIRECTORY": str(path.parent)})
    with pytest.raises(InputError, match="others may read"):
        read_private_key(path, {"CREDENTIALS_DIRECTORY": "/run/credentials"})


def test_a_roster_that_does_not_name_the_own_key_is_one_line(command, refused, keyed):
    own = key_places(keyed).private("wing").read_bytes()
    assert command("keys", "rotate", keyed, "wing").status == 0
    key_places(keyed).private("wing").write_bytes(own)
    line = refused(*COMPANION)
    assert line.startswith("the private key of 'wing' is not the one that the roster names")


@pytest.mark.parametrize("option", ["--key", "--roster"])
def test_insecure_goes_with_no_key(refused, keyed, option):
    line = refused(*COMPANION, "--insecure", option, keyed)
    assert line == "--insecure: nothing is signed; leave it out, or --key and --roster"


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"", "formation: is missing"),
        (b"- a", "formation: is missing"),
        (b"{", "is no YAML"),
        (b"\xff\xfe\x00", "is no YAML"),
        (b"formation: pair\nvehicles: [lead]", "vehicles: holds no names"),
        (b"formation: pair\nvehicles: {lead: abc}", "vehicles: lead: is no public key"),
        (b"formation: pair\nvehicles: {lead: 12}", "vehicles: lead: is no public key"),
        (b"formation: pair\npassword: x", "password: is not known"),
        (
            b"formation: pair\nvehicles: {a: '" + b"00" * 32 + b"', b: '" + b"00" * 32 + b"'}",
            "same",
        ),
        (b"x" * 300_000, "too long"),
    ],
)
def test_a_roster_that_is_none_is_one_line(refused, keyed, content, fault):
    roster = key_places(keyed).roster
    roster.write_bytes(content)
    line = refused(*COMPANION)
    assert line.startswith(f"{roster}: ")
    assert fault in line


def test_a_key_of_another_kind_is_refused(refused, keyed):
    path = key_places(keyed).private("wing")
    other = generate_private_key(65537, 2048)
    for content in (
        other.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()),
        b"not a key",
        b"",
    ):
        path.write_bytes(content)
        line = refused(*COMPANION)
        assert line == f"{path}: is no private Ed25519 key in PEM form; see `vfguide keys make`"


def test_a_status_without_a_roster_says_how_to_make_one(refusal, mission):
    line = refusal("status", mission, "--link=mqtt://127.0.0.1:1")
    assert "there is no roster; make keys with `vfguide keys make MISSION`" in line


def test_the_name_of_an_operator_is_a_name_and_no_vehicles(refusal, mission):
    for name in ("../x", "wing", ""):
        line = refusal("keys", "make", mission, "--operator", name)
        assert line.startswith(f"--operator {name}: write a letter")
