"""Benchmarks against peers, one question per file: `python -m benchmarks`."""
