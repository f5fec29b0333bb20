"""The reference: the paper's formulas in exact arithmetic, and tables computed with it."""
