"""Files: PLY and splat maps, images, video and HTML pages, written whole or not at all."""
