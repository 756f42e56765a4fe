"""Rehearsal of a formation on one computer: emulators and companions, joined by MAVLink."""
