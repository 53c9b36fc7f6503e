"""Throughput and cost against baselines measured in the same run: `python -m benchmarks [ID-PREFIX]`."""
