"""The package's version, which is that of the whole project."""

__version__ = "0.1.0"
