"""Words of `vfguide order` into orders, and one sentence for what is none."""

import pytest

from vfguide.commands.order import order_of
from vfguide.errors import InputError
from vfguide.formation.arrangement import Point
from vfguide.formation.orders import Order


@pytest.mark.parametrize(
    ("words", "spacing", "order"),
    [
        (["vee"], 30.0, Order(shape="vee", spacing=30.0)),
        (["trail"], None, Order(shape="trail")),
        (["spacing"], 25.0, Order(spacing=25.0)),
        (["swap", "f1", "f2"], None, Order(swap=("f1", "f2"))),
        (["slot", "f1=-20,10"], None, Order(slots={"f1": Point(-20.0, 10.0)})),
        (["slot", "f1=-20,10,15"], None, Order(slots={"f1": Point(-20.0, 10.0, 15.0)})),
        (["leave", "f1", "f3"], None, Order(leave=("f1", "f3"))),
        (["join", "f1"], None, Order(join=("f1",))),
        (["abort"], None, Order(action="abort")),
        (["path", "survey"], None, Order(path="survey")),
        (["lead", "f1"], None, Order(lead="f1")),
    ],
)
def test_words_become_an_order(words, spacing, order):
    assert order_of(words, spacing) == order


@pytest.mark.parametrize(
    ("words", "spacing", "sentence"),
    [
        ([], None, "nothing: is no order; there are vee"),
        (["ring"], None, "ring: is no order"),
        (["vee", "f1"], None, "vee f1: is no order"),
        (
            ["spacing"],
            None,
            "spacing: is not complete, or too much; write `vfguide order MISSION spacing",
        ),
        (["swap", "f1"], None, "write `vfguide order MISSION swap A B --link URL`"),
        (["leave"], None, "write `vfguide order MISSION leave NAME --link URL`"),
        (["lead", "f1", "f2"], None, "write `vfguide order MISSION lead NAME --link URL`"),
        (["hold"], 20.0, "--spacing: goes with a shape"),
        (["slot", "f1"], None, "slot f1: write NAME=FORWARD,RIGHT"),
        (["slot", "f1=nan,1"], None, "slot f1=nan,1: write"),
        (["slot", "f1=-4000,1"], None, "no more than 3000 m away"),
    ],
)
def test_what_is_no_order_is_refused_in_a_sentence(words, spacing, sentence):
    with pytest.raises(InputError) as refusal:
        order_of(words, spacing)
    assert sentence in str(refusal.value)
