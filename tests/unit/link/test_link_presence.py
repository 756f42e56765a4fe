import json
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.link import trust_of
from vfguide.link.codec import LinkDataError
from vfguide.link.member import Member
from vfguide.link.presence import Presence, decode_presence, encode_presence, shorter_presences

PLAIN = Presence(
    status="online", mode="tracking", time_s=12.5, version="0.1.0", figures={"delay_ms": 0.25}
)
TEXTS = st.text("abc xyz-_äö", max_size=100)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
SOUND = st.builds(
    Presence,
    status=st.sampled_from(["online", "offline"]),
    mode=TEXTS,
    time_s=FINITE,
    version=TEXTS,
    obstacle=TEXTS,
    autopilot=TEXTS,
    warning=TEXTS,
    findings=st.lists(TEXTS, max_size=3).map(tuple),
    figures=st.dictionaries(st.text("abc_", max_size=8), FINITE, max_size=10),
)
MANY = list(map(str, range(101)))
JSON: Any = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)


@settings(deadline=None, derandomize=True, max_examples=200)
@given(presence=SOUND)
def test_what_goes_in_comes_out(presence):
    assert decode_presence(encode_presence(presence)) == presence


def test_a_presence_is_json_that_anybody_can_read():
    assert json.loads(encode_presence(PLAIN)) == {
        "status": "online",
        "mode": "tracking",
        "time_s": 12.5,
        "version": "0.1.0",
        "signed": False,
        "obstacle": "",
        "autopilot": "",
        "warning": "",
        "findings": [],
        "figures": {"delay_ms": 0.25},
    }


def test_figures_that_are_not_finite_and_fields_that_are_not_known_are_left_out():
    figures = {"a": float("nan"), "b": 1.0, "c": float("inf")}
    assert decode_presence(encode_presence(replace(PLAIN, figures=figures))).figures == {"b": 1.0}
    # Some fields may be missing.
    data = b'{"status":"offline","time_s":1,"colour":"red"}'
    assert decode_presence(data) == Presence(status="offline", mode="", time_s=1.0, version="")


def online(rest: str) -> bytes:
    """A presence of which the rest decides."""
    return f'{{"status":"online",{rest}}}'.encode()


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"online", b"\xff\xfe", b"[]", b"{}", b'{"status":"online"}', b"[" * 4000),
        b'{"status":"ONLINE","time_s":1}',
        online('"time_s":1') + b" " * 5000,
        *(online(f'"time_s":{time}') for time in ("true", "NaN", "1e999", '"1"', "9" * 400)),
        *(online(f'"time_s":1,"mode":{mode}') for mode in ("7", r'"a\nb"')),
        online(f'"time_s":1,"version":"{"v" * 101}"'),
        *(
            online(f'"time_s":1,"findings":{findings}')
            for findings in ('"a"', "[1]", '["a","b","c","d"]', f'["{"v" * 201}"]')
        ),
        *(
            online(f'"time_s":1,"figures":{figures}')
            for figures in ("[1]", '{"a":"b"}', '{"a":null}', json.dumps(dict.fromkeys(MANY, 1)))
        ),
    ],
)
def test_whatever_is_no_presence_is_refused(data):
    with pytest.raises(LinkDataError):
        decode_presence(data)


@settings(deadline=None, derandomize=True, max_examples=300)
@example(content={"status": "online", "time_s": 10**400})
@given(
    content=JSON
    | st.fixed_dictionaries(
        {"status": st.just("online"), "time_s": FINITE, "figures": JSON, "mode": JSON}
    )
)
def test_any_json_is_a_presence_or_refused(content):
    try:
        presence = decode_presence(json.dumps(content).encode())
    except LinkDataError:
        return
    assert decode_presence(encode_presence(presence)) == presence


@settings(deadline=None, derandomize=True, max_examples=300)
@given(data=st.binary(max_size=200))
def test_random_bytes_are_refused_and_raise_nothing_else(data):
    with pytest.raises(LinkDataError):
        decode_presence(data)


def test_where_there_is_little_room_the_number_of_lost_links_goes_last():
    figures = {f"latency_{number}_ms": 1.0 for number in range(60)}
    wide = replace(
        PLAIN,
        obstacle="ä" * 100,
        autopilot="é" * 100,
        warning="\U0001f6e9" * 200,
        findings=("ä" * 200, "b" * 200, "c" * 200),
        figures=figures
        | {"links": 2.0, "links_lost": 1.0, "leader_age_ms_last": 20.0}
        | {"term": 3.0, "order": 2.0**32},
    )
    sizes = [len(encode_presence(one)) for one in shorter_presences(wide)]
    # 1400 bytes less the envelope and its signature.
    assert sizes[0] > 2000
    assert sizes[-1] < 1200
    assert sizes == sorted(sizes, reverse=True)
    for one in shorter_presences(wide):
        assert decode_presence(encode_presence(one)).figures["links_lost"] == 1.0
        assert one.status == "online"
        assert one.obstacle
        assert one.findings


def test_three_findings_in_full_go_in_one_datagram_beside_the_figures_that_people_decide_by():
    """1400 bytes less the envelope: statistics make room, sentences stay whole."""
    findings = ("f" * 200, "g" * 200, "h" * 200)
    figures = {f"latency_{number}_ms": 1.0 for number in range(60)}
    said = replace(PLAIN, warning="w" * 100, findings=findings, figures=figures)
    fitting = next(one for one in shorter_presences(said) if len(encode_presence(one)) < 1200)
    assert fitting.findings == findings
    # Letters beyond ASCII take no more room than in UTF-8.
    long = encode_presence(replace(PLAIN, warning="ä" * 100))
    assert len(long) - len(encode_presence(PLAIN)) == 200


def test_a_presence_that_no_envelope_has_room_for_goes_with_less_in_it():
    figures = {f"{'n' * 90}{number}": 1.0 for number in range(60)}
    member = Member(trust_of("f1", 1, signed=False), clock=lambda: 0.0)
    sent = decode_presence(member.presence(replace(PLAIN, figures=figures)).body)
    assert (sent.mode, sent.figures) == (PLAIN.mode, {})
