"""Open questions of recordings, and what further recordings would answer."""

from scara_ident.inquiry.answerability import Inquiry, inquire, inquiry_of
from scara_ident.inquiry.next_steps import NextStep, next_steps
from scara_ident.inquiry.questions import Question, questions

__all__ = ["Inquiry", "NextStep", "Question", "inquire", "inquiry_of", "next_steps", "questions"]
