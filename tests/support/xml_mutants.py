"""Mutants of an XML file: what careless editors, generators and attackers make of one."""

import random
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import mbs
from mbs import MbsError

_ODD = (
    *("", "0", "-1", "1e308", "-1e-308", "nan", "inf", "-inf", "1 2", "0 0 0", "1 0 0 0", "x"),
    *("true", "auto", "world", "base", "j1", "j2", "a", "b", "hinge", "ball", "free", "mesh"),
    *("\u00e9\u4e2d", "a b", "\u202e", "'", "&lt;", "1,2,3", "9" * 400, "1 " * 200),
    *("-1e-320", "0x1p3", "1_0", "\u0663", "${x}", "$(arg y)", "a.b", "../../x", "&unknown;"),
    *("floating", "planar", "fixed", "revolute", "root_joint", "<![CDATA[", "]]>", "--", "<"),
)
LONGEST_SENTENCE, LONGEST_NOTE = 1200, 500
"""Letters: names of others are quoted in part, and some sentences name several."""


def mutated(rng: random.Random, text: str) -> str:
    """The text with one to three changes of attributes, elements or letters."""
    changes = (_value, _value, _value, _value, _without, _without, _twice, _letter, _swapped)
    for _ in range(rng.choice((1, 1, 2, 3))):
        text = rng.choice(changes)(rng, text)
    return text


def torn(rng: random.Random, text: str) -> str:
    """The text with a span, mostly from one element to another, left out or standing twice."""
    marks = [k for k, letter in enumerate(text) if letter == "<"] or [0]
    a = rng.choice(marks if rng.random() < 0.8 else range(len(text) or 1))
    later = [k for k in marks if k > a][:8]
    b = rng.choice(later) if later else len(text)
    if rng.random() < 0.5:
        return text[:a] + text[b:]
    at = rng.choice(marks)
    return text[:at] + text[a:b] + text[at:]


def encoded(rng: random.Random, text: str) -> bytes:
    """The text as bytes, some in another encoding than the file says or with bytes that are odd."""
    encoding = rng.choice(("utf-8",) * 12 + ("latin-1", "utf-16"))
    content = bytearray(text.encode(encoding, "replace"))
    for _ in range(rng.choice((0,) * 12 + (1, 3)) if content else 0):
        content[rng.randrange(len(content))] = rng.randrange(256)
    return bytes(content)


def outcome(content: bytes, path: Path, rng: random.Random, assembled: float = 1.0) -> str:
    """What becomes of a mutant: "read" or "refused"; anything else is raised.

    Args:
        content: of the file.
        path: where it is written.
        rng: of the options.
        assembled: part of the mechanisms that are assembled, too.
    """
    path.write_bytes(content)
    base = rng.choice((None, None, "fixed", "free"))
    try:
        mechanism = mbs.load(path, base=base)
        for note in mechanism.notes:
            assert "\n" not in str(note)
            assert len(str(note)) < LONGEST_NOTE
        if rng.random() < assembled and any(True for _ in mechanism.joints()):
            mechanism.assemble()
    except MbsError as error:
        sentence = str(error)
        assert "\n" not in sentence, sentence
        assert len(sentence.replace(str(path), "")) < LONGEST_SENTENCE, sentence
        return "refused"
    return "read"


def search_by_hand(
    mutant: Callable[[random.Random], bytes], name: str, assembled: float = 1.0
) -> None:
    """Make as many mutants as the command line says, and keep those that break something.

    Args:
        mutant: makes one.
        name: of the files.
        assembled: as of `outcome`.
    """
    with tempfile.TemporaryDirectory() as folder:
        counts: Counter[str] = Counter()
        for seed in range(int(sys.argv[1])):
            rng = random.Random(1000 + seed)
            content = mutant(rng)
            try:
                counts[outcome(content, Path(folder) / name, rng, assembled)] += 1
            except Exception as error:
                Path(f"mutant-{seed}-{name}").write_bytes(content)
                print(seed, type(error).__name__, str(error)[:300], flush=True)
        print(dict(counts))


def _value(rng: random.Random, text: str) -> str:
    """Another value of an attribute."""
    found = list(re.finditer(r'="([^"]*)"', text))
    if not found:
        return text
    spot = rng.choice(found)
    count = len(spot.group(1).split())
    chance = rng.random()
    if chance < 0.4:
        alike = [m.group(1) for m in found if len(m.group(1).split()) == count]
        new = rng.choice(alike)
    elif chance < 0.7:
        new = " ".join(
            f"{rng.choice((-1, 0, 1e-9, 1, 1e6)) * rng.random():.3g}" for _ in range(count)
        )
    else:
        new = rng.choice(_ODD)
    return f'{text[: spot.start()]}="{new}"{text[spot.end() :]}'


def _without(rng: random.Random, text: str) -> str:
    """An attribute or an element less."""
    pattern = rng.choice((r'\s\w+="[^"]*"', r"<\w+[^<>]*/>"))
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    spot = rng.choice(found)
    return text[: spot.start()] + text[spot.end() :]


def _twice(rng: random.Random, text: str) -> str:
    """An element once more, or in another place."""
    found = list(re.finditer(r"<\w+[^<>]*/>", text))
    if not found:
        return text
    into, spot = rng.choice(found), rng.choice(found)
    return text[: into.start()] + spot.group() + text[into.start() :]


def _letter(rng: random.Random, text: str) -> str:
    """A letter changed, or the rest cut off."""
    if rng.random() < 0.1:
        return text[: rng.randrange(len(text))]
    k = rng.randrange(len(text))
    return text[:k] + rng.choice("<>&\"'/= 0a\x00\x07\u00e9") + text[k + 1 :]


def _swapped(rng: random.Random, text: str) -> str:
    """The name of an element or attribute taken by another one."""
    names = re.findall(r"[<\s](\w+)(?=[\s=/>])", text)
    if not names:
        return text
    old, new = rng.choice(names), rng.choice(names)
    return re.sub(rf"\b{re.escape(old)}\b", new, text, count=rng.randint(1, 2))
