"""The source paper's figures from simulated data, and a verdict on each of its sentences that can be checked."""
