"""Version history of a map on disk: deltas between versions, snapshots, and typed causes."""
