"""Beside the walk: other libraries' interfaces, so that they and this one know each other's things.

In: environments of `detpg.environments`, or one's own. Out: what Gymnasium and what is built on it
take (`detpg.integrations.gymnasium`). Next: other libraries.
"""
