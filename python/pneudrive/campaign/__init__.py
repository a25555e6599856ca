"""Campaigns: a protocol becomes a plan of cycles, a rig runs the cycles, and a folder stores each cycle.

``protocol`` reads the TOML file. ``plan`` lists the cycles and checks them against a rig. ``run`` runs them on a
rig. ``folder`` stores the results for all later steps.
"""
