"""Report of a campaign or of a comparison of two."""
