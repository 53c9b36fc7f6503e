"""The version, importable from below without the public names above."""

__version__ = "0.1.0"
