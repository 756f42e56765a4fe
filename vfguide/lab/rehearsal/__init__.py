"""A whole formation on one computer: emulators and companions, joined by MAVLink bytes."""
