"""From a protocol to a plan of cycles, checked against a rig."""
