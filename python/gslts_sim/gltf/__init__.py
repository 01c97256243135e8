"""Reading and writing of homes as glTF files."""
