"""What tests are made of: missions, aircraft, companions, formations, links and records.

Everything here is a plain function or class, so that a test reads as what it shows.
"""
