"""Map keeper: a robot patrols a home, and its map follows the changes."""
