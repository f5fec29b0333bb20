"""The command line.  Each command is a module that parses options, calls the library, and shows the
result.
"""
