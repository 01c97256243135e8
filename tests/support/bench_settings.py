"""Settings with which benchmarks make small maps in seconds."""

SETTINGS = ("--preset", "fast", "--set", "iterations=300", "--set", "rough_epochs=0")
