"""Flight records of real flights, from companions' recordings or autopilots' logs."""
