"""The link that the formation shares: leader states as bytes, and what carries them. docs/link.md."""

import logging

from vfguide.link.carrier import Carrier, DatagramCarrier, LinkAddress, link

__all__ = ["Carrier", "DatagramCarrier", "LinkAddress", "link"]

# A program decides what becomes of the log; without this Python prints warnings beside its own words.
logging.getLogger(__name__).addHandler(logging.NullHandler())
