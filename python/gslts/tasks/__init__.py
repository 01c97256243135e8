"""What a map is for: questions about what is where, and ways to it."""
