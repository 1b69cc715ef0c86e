"""How a simulated multirotor moves."""

from sim_bridge.vehicle.dynamics import Vehicle, VelocityCommand

__all__ = ["Vehicle", "VelocityCommand"]
