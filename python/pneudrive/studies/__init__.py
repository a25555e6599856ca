"""Studies: each a client of the public interface, as a user would write it."""
