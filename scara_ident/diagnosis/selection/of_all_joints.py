"""The same effect of all joints and of single ones: what all have alike is not said of each again."""

from __future__ import annotations

from scara_ident.diagnosis.candidates.candidates import Candidate


def takes_in(whole: Candidate, single: Candidate) -> bool:
    """Whether one that is taken out of the data of all joints is the same effect as one of a single joint.

    If it is there, its parts on single joints are found before it where something else hides it on the others.
    """
    return (
        whole.corrects_data
        and not single.corrects_data
        and whole.member.joint is None
        and single.member.joint is not None
        and whole.effect.name == single.effect.name
    )
