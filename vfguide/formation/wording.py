"""What a formation flies, in words."""

from collections.abc import Iterable

from vfguide.formation.arrangement import MAIN_PATH, Arrangement, Manoeuvre, SlotMove, ends
from vfguide.formation.shapes import named_shape


def flown_in_words(number: int, order: Arrangement | None) -> str:
    """What is flown.

    Args:
        number: of the order; 0 before the first.
        order: the order; None where it was not heard.
    """
    if number == 0:
        return "the mission's formation"
    if order is None:
        return "an order that was not heard: slots are not known"
    if order.flown is Manoeuvre.ABORT:
        return "nothing: all was called off"
    text = slots_in_words(order.places)
    if order.path != MAIN_PATH:
        text += f", on the path {order.path}"
    return f"a hold, {text}" if order.flown is Manoeuvre.HOLD else text


def arrangement_in_words(order: Arrangement) -> str:
    """What an order asks for: what is flown, and who is to lead where it says that."""
    text = flown_in_words(order.number, order)
    return f"{text}, {order.lead} leads" if order.lead else text


def slots_in_words(places: Iterable[SlotMove]) -> str:
    """What followers fly in once they have come to their slots."""
    points = ends(places)
    if not points:
        return "no followers"
    shape = named_shape((point.forward, point.right) for point in points.values())
    if shape is None:
        return "slots of their own"
    return f"{shape[0]}, {shape[1]:.0f} m apart"
