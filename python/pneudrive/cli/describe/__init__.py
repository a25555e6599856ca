"""Commands that describe drives, circuits and parts."""
