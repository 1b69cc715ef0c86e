"""Vehicles whose autopilots run elsewhere, as the bridge knows and serves them."""

from sim_bridge.external.autopilot import ExternalAutopilot, build_external

__all__ = ["ExternalAutopilot", "build_external"]
