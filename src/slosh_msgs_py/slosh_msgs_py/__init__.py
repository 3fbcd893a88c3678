"""Python helpers for slosh_msgs: conversions, topic names, QoS profiles and what every node shares."""
