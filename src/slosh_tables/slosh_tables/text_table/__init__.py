"""Tables of numbers as people have them: one reader for all commands."""
