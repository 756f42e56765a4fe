"""Commands write where they are told to: what libraries keep for themselves goes with the command."""

import atexit
import os
import secrets
import shutil
import tempfile
from pathlib import Path

MATPLOTLIB = "MPLCONFIGDIR"
"""The variable that says where Matplotlib keeps its list of fonts; else in the user's home."""


def keep_caches_out_of_home() -> None:
    """Have Matplotlib keep its list of fonts where it is gone at the end, unless the user names a place."""
    if os.environ.get(MATPLOTLIB):
        return
    # Made by Matplotlib, where anything is drawn.
    place = Path(tempfile.gettempdir()) / f"vfguide-fonts-{secrets.token_hex(8)}"
    os.environ[MATPLOTLIB] = str(place)
    atexit.register(shutil.rmtree, place, ignore_errors=True)
