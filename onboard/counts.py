"""What an onboard process counts; its status tells."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Counts"]


@dataclass(slots=True)
class Counts:
    """What an onboard process has done since it began.

    Attributes:
        setpoints: Setpoints sent.
        setpoint_gap_max_s: Longest pause between two of one stream, s.
        plans: Plans made.
        deadline_misses: Plans that were not published by the end of their slot.
        peer_bytes_sent: On the peer link.
        peer_bytes_received: On the peer link.
        detections: Detections accepted.
        refused: Valid frames whose content was refused.
    """

    setpoints: int = 0
    setpoint_gap_max_s: float = 0.0
    plans: int = 0
    deadline_misses: int = 0
    peer_bytes_sent: int = 0
    peer_bytes_received: int = 0
    detections: int = 0
    refused: int = 0
