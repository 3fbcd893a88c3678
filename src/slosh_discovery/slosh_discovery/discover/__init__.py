"""Discovery: where a model and measurements disagree, and which effect is missing.

Pure: measured motions and a model in, a finding out; no files, no clock.
"""
