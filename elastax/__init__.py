"""Modelling, inverting and simulating structurally elastic robots."""
