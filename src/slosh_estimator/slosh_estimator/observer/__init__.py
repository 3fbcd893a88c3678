"""Observer that corrects the model's estimate by measured heights."""
