"""The page on which two clicks give `slosh calibrate --scale` its points."""
