"""Camera pose of single images in a map, and direct image alignment."""
