"""What watches and commands: command line, launcher, telemetry, recording, summary."""
