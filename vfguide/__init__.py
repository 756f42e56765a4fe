"""Companion-computer guidance that flies fixed-wing UAVs as one formation."""
