"""Effects of physics and sensors that a model may include, one module each.

A module of this folder that defines `EFFECT` is an effect; nothing else needs to know of it.
"""
