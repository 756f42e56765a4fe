"""One companion per vehicle: telemetry and leader state in, setpoints and leader state out."""
