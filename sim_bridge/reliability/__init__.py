"""The fault suite: seeded virtual flights over faults and phases of flight, each held to a reaction and a deadline."""
