"""Speed and cost against baselines of the same run: `python -m benchmarks [ID-PREFIX]`."""
