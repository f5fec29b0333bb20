"""The command line, with one module per command: it parses, calls the library, shows the result."""
