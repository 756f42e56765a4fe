"""What is done on the ground: rehearsals, studies, reports, logs.

An aircraft needs none of it, and installs none of its libraries.
"""
