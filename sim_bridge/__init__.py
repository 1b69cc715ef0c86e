"""What stands in for the physical world: vehicles, autopilots, motion capture, target robots, detector, radio."""
