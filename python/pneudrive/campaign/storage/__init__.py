"""Folder of a campaign: results of each cycle, which every later step reads."""
