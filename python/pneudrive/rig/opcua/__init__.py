"""Rigs over OPC UA: server, client, and the map of their nodes."""
