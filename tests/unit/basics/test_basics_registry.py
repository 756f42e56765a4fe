"""Laws are found by name, and no name stands for two of them."""

from importlib.metadata import EntryPoint

import pytest

from vfguide import registry
from vfguide.errors import InputError
from vfguide.registry import Registry


class Some:
    """A class to be found."""

    name = ""


class Other(Some):
    """Another one."""


@pytest.fixture
def kinds(monkeypatch: pytest.MonkeyPatch) -> Registry:
    """A registry with one class of its own and one that a package offers."""
    offered = EntryPoint(name="offered", value=f"{__name__}:Other", group="some.kinds")
    monkeypatch.setattr(registry, "installed", lambda _group: {"offered": offered})
    monkeypatch.setattr(EntryPoint, "load", lambda _self: Other)
    return Registry("kind", group="some.kinds", own={"own": __name__})


def test_its_own_come_first_then_the_others_by_name(kinds):
    kinds.register("added")(Some)
    assert kinds.names() == ("own", "added", "offered")
    assert "offered" in kinds
    assert "absent" not in kinds
    assert [] not in kinds


def test_what_a_package_offers_is_loaded_when_it_is_asked_for(kinds):
    assert kinds.find("offered") is Other
    assert Other.name == "offered"


def test_a_name_stands_for_one_class(kinds):
    kinds.register("added")(Some)
    kinds.register("added")(Some)
    with pytest.raises(InputError, match="added: there is a kind of this name already"):
        kinds.register("added")(Other)


def test_a_plugin_does_not_take_the_name_of_one_of_vfguides_own():
    with pytest.raises(InputError, match="slot: there is a law of this name already"):
        registry.laws.register("slot")(Other)


def test_an_unknown_name_is_answered_with_the_known_ones(kinds):
    with pytest.raises(InputError, match="absent: there is no such kind; known are own, offered"):
        kinds.find("absent")
