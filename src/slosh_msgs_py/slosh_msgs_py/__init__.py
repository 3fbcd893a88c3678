"""Python helpers for slosh_msgs, as sensor_msgs_py is to sensor_msgs.

Conversions to immutable values, topic names, QoS profiles, and what every node shares.
"""
