"""State of a cell for controllers outside ROS: OPC UA, MQTT and Modbus TCP."""
