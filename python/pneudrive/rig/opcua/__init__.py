"""A rig behind OPC UA: the server that serves one, the client that drives one, the nodes that both speak of."""
