"""Motion capture: a simulated one and real ones, whose poses go to autopilots as external positions."""

from sim_bridge.mocap.pose import MocapPose
from sim_bridge.mocap.simulated import MotionCapture

__all__ = ["MocapPose", "MotionCapture"]
