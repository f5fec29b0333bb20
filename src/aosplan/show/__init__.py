"""What people look at: figures, the report page, and text on a terminal."""
