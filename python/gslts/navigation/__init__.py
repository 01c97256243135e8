"""Navigation to objects: grid, planner, semantic map and navigator (GS-LTS, sec. III-B)."""
