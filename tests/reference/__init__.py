"""The reference: the paper in exact arithmetic, and tables written from it."""
