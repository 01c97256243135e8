"""Report of a mapping run as an HTML page, and the summary on the command line."""
