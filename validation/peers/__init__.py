"""Compares the discovery with other methods on the same test cases with hidden effects."""
