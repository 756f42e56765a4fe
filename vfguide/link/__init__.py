"""The link that the formation shares: leader states as bytes, and what carries them."""
