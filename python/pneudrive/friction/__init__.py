"""Sliding friction of recordings and of campaigns: what both are reduced by."""
