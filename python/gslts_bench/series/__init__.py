"""Many updates in a row against a map built anew."""
