"""The Change Detection Unit: what differs between a map and what a robot sees."""
