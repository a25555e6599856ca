"""What recordings and campaigns are reduced by: sliding, settling, pairing, budget, peaks, stick-slip."""
