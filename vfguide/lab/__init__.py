"""Tools for the ground: rehearsals, studies, reports, logs.

An aircraft needs none of them, and installs none of their libraries.
"""
