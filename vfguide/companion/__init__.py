"""Companion of a vehicle: telemetry and leader state in, setpoints and leader state out."""
