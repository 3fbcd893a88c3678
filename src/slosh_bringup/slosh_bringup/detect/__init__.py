"""Measurement of recorded images: reads them and writes a table and pictures."""
