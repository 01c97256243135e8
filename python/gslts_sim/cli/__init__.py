"""Commands of the simulator: `gslts sim`."""
