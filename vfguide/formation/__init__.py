"""Formations that change in flight: shapes, who goes where, and slot motions that keep everybody apart."""
