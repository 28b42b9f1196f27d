"""Close the loop: what the model lacks, traced to physics."""

from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.diagnosis.lack_of_fit import LackOfFit, lack_of_fit
from scara_ident.diagnosis.model_selection import Unexplained
from scara_ident.diagnosis.screening import Dependence, screen
from scara_ident.diagnosis.search import Search, search

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
