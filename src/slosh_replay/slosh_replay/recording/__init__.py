"""What a recording holds: its nodes' settings, its topics, its inputs and the motion they tell.

Replay, discovery, export and report read it here; each message is decoded once, as columns.
"""
