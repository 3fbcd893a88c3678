"""Many recordings: their motions in a store that SQL asks, and signed validation reports."""
