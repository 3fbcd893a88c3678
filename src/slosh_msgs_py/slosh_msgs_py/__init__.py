"""Python helpers for slosh_msgs: conversions, topics, QoS and a common base for nodes.

Conversions to immutable values, topic names, QoS profiles, and what every node shares.
"""
