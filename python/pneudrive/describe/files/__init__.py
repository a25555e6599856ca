"""Files of users: reading, writing, catalogue, and where each value comes from."""
