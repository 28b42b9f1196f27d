"""Why a URDF is no tree of links and joints, which its parser does not say."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from xml.etree import ElementTree


def urdf_fault(tree: ElementTree.Element) -> str | None:
    """Return what keeps the links and joints of a URDF from being one tree; None where nothing is found.

    Parameters
    ----------
    tree : Element
        The element ``<robot>``.

    Returns
    -------
    str or None
        A few words that name the links or joints, and what to do.
    """
    links = [link.get("name", "") for link in tree.findall("link")]
    joints = tree.findall("joint")
    for kind, names in (("joint", [joint.get("name", "") for joint in joints]), ("link", links)):
        twice = _repeated(names)
        if twice is not None:
            return f"two {kind}s are named {twice!r}; rename one"
    children = []
    for joint in joints:
        for role in ("parent", "child"):
            element = joint.find(role)
            name = None if element is None else element.get("link")
            if name is None:
                return f"joint {joint.get('name')!r} has no {role} link; name it"
            if name not in links:
                return (
                    f"joint {joint.get('name')!r} names {name!r} as its {role}, and there is no such link; correct it"
                )
            children += [name] if role == "child" else []
    twice = _repeated(children)
    if twice is not None:
        return f"link {twice!r} is the child of two joints; a URDF has no loops, cut one"
    roots = [name for name in links if name not in children]
    if not roots:
        return "every link is the child of a joint; a URDF has no loops, and begins at a link that is no child"
    if len(roots) > 1:
        return f"links {', '.join(map(repr, roots[:3]))} hang on no joint; only one, the base, may"
    return None


def _repeated(names: Iterable[str]) -> str | None:
    return next((name for name, count in Counter(names).items() if count > 1), None)
