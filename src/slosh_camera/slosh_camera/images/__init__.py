"""Images: decoding, colour, repeated or torn frames, and text in images."""
