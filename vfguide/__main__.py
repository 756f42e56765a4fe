"""`python -m vfguide`."""

from vfguide.cli import main

if __name__ == "__main__":
    main()
