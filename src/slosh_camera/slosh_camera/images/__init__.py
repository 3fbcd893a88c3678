"""Images: decoding, colour, repeated or torn frames, text on them."""
