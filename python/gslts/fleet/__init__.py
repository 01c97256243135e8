"""Many robots and machines: shared maps, buildings of maps, and jobs on a cluster."""
