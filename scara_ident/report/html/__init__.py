"""Reports as single HTML files that need no network."""

from scara_ident.report.html.comparison import comparison_report
from scara_ident.report.html.diagnosis import DiagnosisContext, diagnosis_report
from scara_ident.report.html.excitation import excitation_report
from scara_ident.report.html.fleet import fleet_report
from scara_ident.report.html.identification import IdentificationContext, identification_report
from scara_ident.report.html.paper import paper_report

__all__ = [
    "DiagnosisContext",
    "IdentificationContext",
    "comparison_report",
    "diagnosis_report",
    "excitation_report",
    "fleet_report",
    "identification_report",
    "paper_report",
]
