"""Makes tables of recordings and recordings of tables."""
