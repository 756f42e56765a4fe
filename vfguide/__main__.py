"""`python -m vfguide`."""

from vfguide.cli import main

main()
