"""A team in lock-step: the agents that fly, without processes, autopilots or links, in virtual time.

Step by step, every robot looks, fuses, and now and then plans; then everything moves on by τ. For Monte-Carlo
experiments and for tests of faults; ``sim_bridge/virtual_team.py`` flies the whole stack instead.
"""
