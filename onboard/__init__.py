"""What flies: planning, estimation, mapping, protocol and flight control of one vehicle.

This package imports neither ``sim_bridge`` nor ``gcs``.
"""
