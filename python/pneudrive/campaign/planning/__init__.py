"""Convert a protocol to a plan of cycles, and check the plan against a rig."""
