"""The guidance laws: pure functions of state and time.

Frame: local north-east-down; course and heading clockwise from north in radians; the wind vector is the
one the air moves toward. No clock, socket, log or file is touched from here.
"""
