"""Makes the API pages from the sources: python docs/make_api.py [DIRECTORY]."""

import importlib
import pkgutil
import sys
import warnings
from pathlib import Path

import pdoc

import sitl_stub
import vfguide

HIDDEN = ("vfguide.cli", "vfguide.commands", "vfguide.__main__", "sitl_stub.__main__")
"""Command lines have no page: docs/commands.md and `--help` describe them."""


def show_submodules() -> None:
    """Have every package show its modules beside the names that it offers itself."""
    for root in (vfguide, sitl_stub):
        for found in pkgutil.walk_packages(root.__path__, f"{root.__name__}."):
            package, _, name = found.name.rpartition(".")
            offered = getattr(importlib.import_module(package), "__all__", None)
            if offered is not None and not found.name.startswith(HIDDEN):
                offered.append(name)


def make_pages(directory: Path) -> None:
    """Write one page for each module; what cannot be documented is an error."""
    for name in vfguide.__all__:
        # The package imports them when they are asked for; a page shows what is there.
        setattr(vfguide, name, getattr(vfguide, name))
    show_submodules()
    # Its list of fonts, made once, takes programs to be run, which pdoc does not let modules do on import.
    importlib.import_module("matplotlib.font_manager")
    pdoc.render.configure(docformat="google", show_source=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pdoc.pdoc(
            "vfguide", "sitl_stub", *(f"!{one}" for one in HIDDEN), output_directory=directory
        )


if __name__ == "__main__":
    make_pages(Path(sys.argv[1] if sys.argv[1:] else "site"))
