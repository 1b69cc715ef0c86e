"""Fuzz targets of everything that reads what strangers write: frames, scenarios, problems, a whole onboard computer."""
