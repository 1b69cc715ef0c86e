"""What any simulated autopilot consists of, whichever firmware it behaves like."""
