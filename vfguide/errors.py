"""The exceptions that vfguide raises on purpose."""


class VfguideError(Exception):
    """Something vfguide can explain in one line; the root of all its exceptions."""


class InputError(VfguideError):
    """The input is wrong, and only whoever wrote it can put it right: exit status 2."""
