"""Images by themselves: whole, in colour, repeated or moved; words on them."""
