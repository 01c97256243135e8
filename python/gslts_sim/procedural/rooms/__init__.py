"""How people furnish a kitchen, a living room and a bedroom: one file a room type."""
