"""Close the loop: what the model lacks, traced to physics."""

from scara_ident.diagnosis.answerability import Inquiry, inquire, inquiry_of
from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.diagnosis.lack_of_fit import LackOfFit, lack_of_fit
from scara_ident.diagnosis.next_steps import NextStep, next_steps
from scara_ident.diagnosis.outcome import Unexplained
from scara_ident.diagnosis.questions import Question, questions
from scara_ident.diagnosis.screening import Dependence, screen
from scara_ident.diagnosis.search import Search, search

__all__ = [
    "Dependence",
    "Diagnosis",
    "FoundEffect",
    "Inquiry",
    "LackOfFit",
    "NextStep",
    "Question",
    "Search",
    "Unexplained",
    "diagnose",
    "inquire",
    "inquiry_of",
    "lack_of_fit",
    "next_steps",
    "questions",
    "screen",
    "search",
]
