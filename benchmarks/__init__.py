"""Throughput and cost beside baselines of the same run: `python -m benchmarks [ID-PREFIX]`."""
