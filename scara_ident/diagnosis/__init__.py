"""Close the loop: what the model lacks, traced to a physical effect."""

from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.diagnosis.evidence.outcome import Unexplained
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.diagnosis.selection.search import Search, search
from scara_ident.diagnosis.testing.lack_of_fit import LackOfFit, lack_of_fit
from scara_ident.diagnosis.testing.screening import Dependence, screen

__all__ = [
    "Dependence",
    "Diagnosis",
    "FoundEffect",
    "LackOfFit",
    "Search",
    "Unexplained",
    "diagnose",
    "lack_of_fit",
    "screen",
    "search",
]
