"""Flight: autopilot link, setpoint stream, flight state machine."""
