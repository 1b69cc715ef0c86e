"""Mapping: the visibility grid, its frontiers and the exploration landmarks on them."""
