"""Fault injection: a schedule says what is wrong now, and a wrapper around each component makes it so."""

from sim_bridge.faults.schedule import TAKEN_OFF_M, Change, Fault, FaultSchedule

__all__ = ["TAKEN_OFF_M", "Change", "Fault", "FaultSchedule"]
