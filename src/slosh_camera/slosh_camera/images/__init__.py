"""Images by themselves: read from messages and files, whole, new, and of the same scene."""
