"""What the documentation adds to Sphinx, and what its pages are generated and tested with."""
