"""Campaigns: a protocol becomes a plan of cycles, a rig runs them, a folder keeps every one.

``protocol`` reads the TOML file; ``plan`` lays out the cycles and checks them against a rig; ``run`` runs them on
a rig; ``folder`` is what a campaign leaves, and what everything after it reads.
"""
