"""Estimation: target models, the range-bearing sensor, the distributed block information filter."""
