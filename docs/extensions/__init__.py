"""Extensions of Sphinx, and functions that generate and test the pages of the documentation."""
