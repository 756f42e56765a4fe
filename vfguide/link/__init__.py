"""The link that the formation shares: leader states as bytes, and what carries them."""

import logging

# A program decides what becomes of the log; without this Python prints warnings beside its own words.
logging.getLogger(__name__).addHandler(logging.NullHandler())
