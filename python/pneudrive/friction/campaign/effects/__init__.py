"""Effects of pressure, position, air and time, the zero of the sensor, stick-slip."""
