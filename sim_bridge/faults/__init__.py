"""Fault injection: a schedule says what is wrong now, and a wrapper around each component makes it so."""

from sim_bridge.faults.schedule import Change, Fault, FaultSchedule

__all__ = ["Change", "Fault", "FaultSchedule"]
