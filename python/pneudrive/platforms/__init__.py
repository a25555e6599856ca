"""Platforms on legs: kinematics and workspace."""

from pneudrive.platforms.kinematics import Platform, PoseLimits, platform, platforms

__all__ = ["Platform", "PoseLimits", "platform", "platforms"]
