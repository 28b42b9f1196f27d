"""The meaning of a column's name: quantity, joint, unit, and whether it was measured or commanded; else its place."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scara_ident.arrays import Array
from scara_ident.inspection.values import MIN_CORRELATION, averages, slopes, time_unit
from scara_ident.robot.units import ALSO, find_unit, is_unit, table_of

QUANTITIES = {
    "position": "position positions pos q jpos qpos angle angles ang theta encoder enc winkel drehwinkel lage",
    "velocity": "velocity velocities vel qd dq qdot qvel dtheta thetadot speed speeds spd omega geschwindigkeit winkelgeschwindigkeit drehzahl "
    "vitesse vitesses",
    "acceleration": "acceleration accelerations acc accel qdd ddq qddot ddtheta thetaddot beschleunigung winkelbeschleunigung",
    "effort": "effort efforts torque torques trq tau current currents curr cur amp amps moment moments force forces drehmoment kraft "
    "strom couple couples courant courants",
    "temperature": "temperature temperatures temp temps temperatur",
    "time": "time times t timestamp timestamps stamp clock date datetime zeit zeitstempel uhrzeit temps heure horodatage",
}
"""Words that loggers use for each quantity, in English, German and French, without accents."""

# The French word for time is also the plural of a short temperature; of the arm, not of a joint, it is the time.
_BOTH = "temps"
# Written behind a position, as in qDot, q_dot and theta_ddot: its slope, and the slope of that.
_SLOPES = {
    ("dot",): "velocity",
    ("ddot",): "acceleration",
    ("d", "dot"): "acceleration",
    ("dot", "dot"): "acceleration",
}
# What German and short names put before such words: is and shall, and whose.
_PREFIXES = ("ist", "soll", "akt", "act", "gelenk", "achsen", "achs", "motor")
_WORDS = {word: quantity for quantity, words in QUANTITIES.items() for word in words.split()} | {_BOTH: "temperature"}
COMMANDED = frozenset(
    ["target", "desired", "des", "command", "commanded", "cmd", "ref", "reference", "setpoint", "goal", "planned",
     "soll", "sollwert", "vorgabe", "consigne", "commande", "cible"]
)  # fmt: skip
MEASURED = frozenset(
    ["actual", "act", "measured", "meas", "feedback", "fb", "sensor", "ist", "akt", "aktuell", "gemessen", "mesure",
     "mesuree", "reel"]
)  # fmt: skip
# Of an effort that was computed from a model of the arm; an estimate may as well be of a current.
COMPUTED = frozenset(
    ["model", "modelled", "modeled", "computed", "calculated", "calc", "predicted", "ff", "feedforward", "theoretical",
     "modell", "berechnet", "vorsteuerung", "modele", "calcule", "theorique"]
)  # fmt: skip
# Of such columns no channel of a joint is made.
OTHER = frozenset(
    ["error", "err", "std", "min", "max", "limit", "limits", "tcp", "tool", "cartesian", "pose", "gripper", "imu",
     "fehler", "werkzeug", "greifer", "erreur", "outil", "pince"]
)  # fmt: skip
# Of an encoder behind the gear, where there is another one before it.
LINK_SIDE = frozenset(("link", "load", "output", "secondary", "second", "se", "abtrieb", "abtriebsseitig"))
# Of what turns; a joint that slides has none of them.
ANGLE = frozenset(("angle", "angles", "ang", "theta", "winkel", "drehwinkel"))
# Of an arm its positions first of all, where nothing else is.
STATE = frozenset(("state", "states"))
# Of what is around the arm.
AROUND = frozenset(("environment", "env", "object"))
GENERIC = frozenset(("joint", "link", "axis", "motor", "gelenk", "achse", "axe", "articulation", "moteur"))
CURRENT = frozenset(("current", "currents", "curr", "cur", "amp", "amps", "i", "strom", "courant", "courants"))
# Such a word says that a value is of now where it stands before a quantity; before a letter, as in current_t, it is one.
_OF_NOW = frozenset(("current", "curr", "cur"))
# An amplifier, unless what was measured or asked for is so many of its unit.
_AMPLIFIER = "amp"
TORQUE = frozenset(
    ["torque", "torques", "trq", "tau", "moment", "moments", "force", "forces", "drehmoment", "kraft", "couple",
     "couples"]
)  # fmt: skip

# A joint's number has no more; Python makes no number of thousands.
MAX_DIGITS = 9
_TOKEN = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+")
_BRACKETS = re.compile(r"[\[(<{]\s*([^\])>}]*?)\s*[\])>}]")
# Units at the end of a name, as in elbow_pos_deg; a bare letter would be taken for too much.
_ENDINGS = {
    "rad": "rad", "radians": "rad", "deg": "deg", "degrees": "deg", "turns": "turn", "rev": "turn", "counts": "count",
    "ticks": "count", "mm": "mm", "um": "um", "ms": "ms", "us": "us", "ns": "ns", "msec": "ms", "usec": "us",
    "nsec": "ns", "sec": "s", "seconds": "s", "rpm": "rpm", "nm": "N m", "amps": "A", "percent": "%",
    "grad": "deg", "degre": "deg", "degres": "deg", "prozent": "%",
}  # fmt: skip
# A whole turn in the units in which angles are usually recorded.
TURNS = (2.0 * np.pi, 360.0)
# Columns without names, in blocks of one for each joint: what slopes confirm comes first, and may have others behind it.
CONFIRMED = ("position", "velocity", "effort")
BLOCKS = (CONFIRMED, ("position", "effort"))
# What the columns of a table without a header are called.
_NAMELESS = re.compile("column_[0-9]+")
# Units that their capitals tell from other words.
_CAPITALS = re.compile(r"(?:^|[_ .])(mA|A|mNm|Nm|N)(?=$|[_ .\[])")
# Messages of ROS, whose positions are in rad and m (REP 103), as they stand in the columns of an export.
JOINT_STATES = re.compile(r"joint_?states?\b", re.IGNORECASE)
# What parts the levels of a path, and the fields of a structure.
_LEVEL = re.compile("[/.]")
# What German writes where umlauts cannot be written; accents of other languages are left out there.
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "AE", "Ö": "OE", "Ü": "UE"})


@dataclass(frozen=True)
class Meaning:
    """What a column's name says.

    Attributes
    ----------
    quantity : str or None
        A key of `QUANTITIES`.
    joint : int or None
        Index of the joint that it names.
    number : int or None
        The last number in the name, without that of the joint's name.
    unit : str or None
        Unit that it names, of that quantity.
    commanded, measured : bool
        Whether it says that the value was asked for, or sensed.
    template : str
        The name with the joint or number replaced by a placeholder: equal for the channels of one signal.
    stem : str
        The template without its unit: equal where joints that turn and joints that slide have units of their own.
    words : frozenset of str
        Its words in small letters.
    """

    quantity: str | None
    joint: int | None
    number: int | None
    unit: str | None
    commanded: bool
    measured: bool
    template: str
    stem: str
    words: frozenset[str]


def meaning(name: str, joints: Sequence[str] = ()) -> Meaning:
    """Read the name of a column.

    Parameters
    ----------
    name : str
        Name as it stands in the file.
    joints : sequence of str
        Joints of the arm.
    """
    tokens = list(_TOKEN.finditer(_without_accents(name)))
    words = [token[0].lower() for token in tokens]
    joint, span = _joint([_spellings(name[token.start() : token.end()]) for token in tokens], joints)
    rest = [k for k in range(len(words)) if span is None or not span[0] <= k < span[1]]
    numbers = [k for k in rest if words[k].isdigit() and len(words[k]) <= MAX_DIGITS]
    spoken = _spoken([words[k] for k in rest])
    template, number = name, None
    if span is not None:
        template = f"{name[: tokens[span[0]].start()]}{{joint}}{name[tokens[span[1] - 1].end() :]}"
    elif numbers:
        last = tokens[numbers[-1]]
        number = int(last[0])
        template = f"{name[: last.start()]}{{number}}{name[last.end() :]}"
    alone = joint is None and number is None
    found = ["time" if word == _BOTH and alone else _WORDS[word] for word in spoken if word in _WORDS]
    if not found and "i" in spoken and (joint is not None or number is not None):
        found = ["effort"]
    signals = [quantity for quantity in found if quantity != "time"]
    quantity = signals[-1] if signals else found[-1] if found else None
    # Of a path, or a structure, the last name says what it is: the clock of a group of positions is no position.
    *above, own = _LEVEL.split(_without_accents(name))
    known_words = {
        _WORDS[part] for token in _TOKEN.finditer(own) for part in _parts(token[0].lower()) if part in _WORDS
    }
    if any(above) and known_words == {"time"}:
        quantity = "time"
    # A unit such as U/min is no minimum.
    outside = {token[0].lower() for token in _TOKEN.finditer(_BRACKETS.sub("", name))}
    if OTHER & set(spoken) & outside or (quantity == "time" and (joint is not None or number is not None)):
        quantity = None
    return Meaning(
        quantity=quantity,
        joint=joint,
        number=number,
        unit=None if quantity is None else _unit(name, spoken, quantity),
        commanded=bool(COMMANDED & set(spoken)),
        measured=bool(MEASURED & set(spoken)),
        template=template,
        stem=_without_unit(template),
        words=frozenset(spoken),
    )


def states_as_positions(meanings: Mapping[str, Meaning]) -> dict[str, Meaning]:
    """Return the columns of a state by number, such as ``observation.state[0]``, as positions, which the name alone does not say."""
    return {
        name: replace(said, quantity="position")
        for name, said in meanings.items()
        if said.quantity is None
        and said.number is not None
        and said.words & STATE
        and not said.words & (OTHER | AROUND)
    }


def _without_accents(text: str) -> str:
    """Return a text of the same length without accents."""
    return "".join("s" if letter == "ß" else unicodedata.normalize("NFKD", letter)[0] for letter in text)


def _spellings(text: str) -> frozenset[str]:
    """Return a text in small letters as it is written without accents, and without umlauts."""
    return frozenset(map(_plain, (text, text.translate(_UMLAUTS))))


def _plain(text: str) -> str:
    letters = unicodedata.normalize("NFKD", text.casefold())
    return "".join(letter for letter in letters if not unicodedata.combining(letter))


def _without_unit(template: str) -> str:
    bare = _BRACKETS.sub(lambda found: "" if is_unit(found[1]) else found[0], template).rstrip()
    last = next(reversed(list(_TOKEN.finditer(bare))), None)
    if bare != template or last is None or last.end() < len(bare) or last[0].lower() not in _ENDINGS:
        return bare
    return bare[: last.start()].rstrip("_ .-")


def _parts(word: str) -> list[str]:
    """Split a German word such as Istposition before the quantity."""
    for prefix in _PREFIXES:
        if word not in _WORDS and word.removeprefix(prefix) in _WORDS and word != prefix:
            return [prefix, word.removeprefix(prefix)]
    return [word]


def _with_slopes(words: list[str]) -> list[str]:
    """Return words in which a position and the dots behind it are the quantity that they spell."""
    for k, word in enumerate(words):
        for dots, quantity in reversed(_SLOPES.items()):
            if _WORDS.get(word) == "position" and tuple(words[k + 1 : k + 1 + len(dots)]) == dots:
                return [*words[:k], quantity, *_with_slopes(words[k + 1 + len(dots) :])]
    return words


def _spoken(words: Sequence[str]) -> list[str]:
    """Return the words of a name, without what is no quantity beside the next or the last one."""
    parts = _with_slopes([part for word in words for part in _parts(word)])
    beside = zip(["", *parts], parts, [*parts[1:], ""], strict=False)
    return [
        word
        for before, word, behind in beside
        if not (word in _OF_NOW and behind in _WORDS and len(behind) > 1)
        and not (word == _AMPLIFIER and before not in MEASURED | COMMANDED)
    ]


def _unit(name: str, words: Sequence[str], quantity: str) -> str | None:
    tables = [table_of(quantity, linear=linear) for linear in (False, True)]
    last = next((word for word in reversed(words) if not word.isdigit()), "")
    spelled = [_ENDINGS[last]] if last in _ENDINGS else []
    for word in (*_BRACKETS.findall(name), *_CAPITALS.findall(name), *spelled):
        # A speed called deg is in deg/s.
        for ending in ("", "/s", "/s^2"):
            for table in tables:
                unit = find_unit(ALSO.get(word.lower(), word) + ending, table)
                if unit is not None:
                    return unit.name
    return None


def _joint(words: Sequence[frozenset[str]], joints: Sequence[str]) -> tuple[int | None, tuple[int, int] | None]:
    """Find the joint that a name contains, by its longest form, and the words that it takes, each in its spellings."""
    best: tuple[int, int, tuple[int, int]] | None = None
    for index, forms in enumerate(_forms(joints)):
        for form in forms:
            for start in range(len(words) - len(form) + 1):
                spelled = words[start : start + len(form)]
                if all(map(frozenset.__contains__, spelled, form)) and (best is None or len(form) > best[0]):
                    best = (len(form), index, (start, start + len(form)))
    return (None, None) if best is None else (best[1], best[2])


def _forms(joints: Sequence[str]) -> list[list[tuple[str, ...]]]:
    """List for every joint the words by which a logger may call it; no form stands for two joints."""
    spelled = [joints, [joint.translate(_UMLAUTS) for joint in joints]]
    forms = [list(dict.fromkeys(each)) for each in map(list.__add__, *map(_every_form, spelled))]
    every = [form for mine in forms for form in mine]
    return [[form for form in mine if every.count(form) == 1] for mine in forms]


def _every_form(joints: Sequence[str]) -> list[list[tuple[str, ...]]]:
    plain = [_without_accents(joint.replace("ß", "ss")) for joint in joints]
    full = [tuple(token[0].lower() for token in _TOKEN.finditer(joint)) for joint in plain]
    shared = 0
    while len(full) > 1 and all(len(words) > shared + 1 and words[shared] == full[0][shared] for words in full):
        shared += 1
    forms: list[list[tuple[str, ...]]] = []
    for words in full:
        mine = [words]
        # panda_joint1 is called joint1, and shoulder_pan_joint shoulder_pan; a number alone is no name.
        shortened = [words[k:] for k in range(1, shared + 1)]
        for shorter in (*shortened, tuple(word for word in words if word not in GENERIC)):
            if shorter not in mine and any(not word.isdigit() and word not in _WORDS for word in shorter):
                mine.append(shorter)
        forms.append(mine)
    return forms


def meanings_by_place(numbers: Mapping[str, Array], counts: Sequence[int]) -> dict[str, Meaning]:
    """Return what columns without names hold, where their number and their slopes say it; nothing where they do not.

    Behind positions, velocities that are their slopes, and efforts there may be more of each joint, such as setpoints.

    Parameters
    ----------
    numbers : mapping of str to ndarray, shape (N,)
        All columns, in the file's order.
    counts : sequence of int
        How many joints there may be, the likeliest first.
    """
    names = list(numbers)
    if not names or time_unit(numbers[names[0]]) is None:
        return {}
    for quantities, count in product(BLOCKS, counts):
        others = len(names) - 1 - len(quantities) * count
        if others and (quantities != CONFIRMED or others < 0 or others % count):
            continue
        parts = np.reshape(names[1 : len(names) - others], (len(quantities), count)).tolist()
        blocks = dict(zip(quantities, parts, strict=True))
        if "velocity" in blocks and not _are_slopes(numbers, names[0], blocks["position"], blocks["velocity"]):
            continue
        return {names[0]: _meaning("time", None)} | {
            name: _meaning(quantity, k + 1) for quantity, block in blocks.items() for k, name in enumerate(block)
        }
    return {}


def nameless(names: Iterable[str]) -> bool:
    """Tell whether no line of a file names its columns."""
    return all(map(_NAMELESS.fullmatch, names))


def _meaning(quantity: str, number: int | None) -> Meaning:
    template = f"{quantity} {{number}}"
    return Meaning(quantity, None, number, None, False, False, template, template, frozenset())


def _are_slopes(numbers: Mapping[str, Array], time: str, positions: Sequence[str], velocities: Sequence[str]) -> bool:
    mean = averages(numbers[time], np.array([numbers[name] for name in velocities]))
    return all(
        any(_is_slope(slopes(numbers[time], reading[None])[0], own) for reading in _readings(numbers[name]))
        for name, own in zip(positions, mean, strict=True)
    )


def _readings(angle: Array) -> list[Array]:
    """Return a position as it stands, and the whole angle that it may be if it is held within one turn, in any unit."""
    held = [turn for turn in TURNS if np.ptp(angle) <= turn]
    return [angle, *(np.unwrap(angle, period=turn) for turn in held)]


def _is_slope(known: Array, recorded: Array) -> bool:
    """Tell whether what was recorded is the slope; of what stands still it may be."""
    if np.std(known) == 0:
        return True
    return bool(np.std(recorded) > 0 and np.corrcoef(known, recorded)[0, 1] >= MIN_CORRELATION)
