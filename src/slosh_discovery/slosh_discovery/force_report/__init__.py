"""The page of an identification from a force."""
