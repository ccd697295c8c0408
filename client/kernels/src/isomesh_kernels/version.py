"""The version of isomesh."""

__version__ = "0.1.0"
