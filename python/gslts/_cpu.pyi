"""Importing this raises an ImportError that says what the processor lacks."""
