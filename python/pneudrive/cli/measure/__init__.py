"""Commands on rigs, recordings and campaigns."""
