"""Platforms on legs: kinematics, dynamics and workspace."""

from pneudrive.platforms.kinematics import LegDynamics, Platform, PoseLimits, is_platform, platform, platforms

__all__ = ["LegDynamics", "Platform", "PoseLimits", "is_platform", "platform", "platforms"]
