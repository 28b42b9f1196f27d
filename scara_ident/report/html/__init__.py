"""Reports as single HTML files that need no network."""

from scara_ident.report.html.identification import identification_report

__all__ = ["identification_report"]
