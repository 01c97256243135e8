"""A map and its history in a browser: live pages, and pages in one file."""
