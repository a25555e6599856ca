"""Files of users: reading, writing, catalogue, and origins of values."""
