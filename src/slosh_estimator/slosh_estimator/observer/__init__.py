"""The observer: corrects the open-loop estimate by measured heights."""
