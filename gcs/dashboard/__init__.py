"""The live dashboard: what the team knows and does, in a browser.

``shapes``, ``view``, ``history``, ``panels`` and ``board`` are plain code that turns :class:`gcs.team.TeamState` into
columns and HTML; ``map_figure``, ``charts``, ``orders`` and ``page`` show these with bokeh; ``server`` serves the page
from a thread of its own, so that the ground station's loop never waits for a browser.
"""
