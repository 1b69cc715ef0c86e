"""What is kept of a flight: writing it down while it happens, and reading it again."""
