"""Robots of elastax in other packages; each module needs its package installed."""
