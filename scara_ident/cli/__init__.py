"""The command line ``scara-ident``; no computation lives here."""

from scara_ident.cli.main import main

__all__ = ["main"]
