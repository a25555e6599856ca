"""Drawing of a circuit with symbols of ISO 1219."""
