"""The project's own planners as :class:`onboard.planning.pluggable.PathPlanner`: ARVI and what it is compared with."""
