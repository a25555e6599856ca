"""Folder of a campaign: the stored results of its cycles."""
