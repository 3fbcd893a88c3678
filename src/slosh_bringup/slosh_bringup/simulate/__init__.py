"""A motion table's prediction: its answer, what looks wrong in the table, files and picture."""
