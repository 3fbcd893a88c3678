"""Other methods on the blind cases: what they are given, their terms, answers and scores."""
