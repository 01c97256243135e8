"""Furnished rooms from a seed."""
