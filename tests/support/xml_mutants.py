"""Mutants of an XML file: what careless editors, generators and attackers make of one."""

import random
import re

_ODD = (
    *("", "0", "-1", "1e308", "-1e-308", "nan", "inf", "-inf", "1 2", "0 0 0", "1 0 0 0", "x"),
    *("true", "auto", "world", "base", "j1", "j2", "a", "b", "hinge", "ball", "free", "mesh"),
    *("\u00e9\u4e2d", "a b", "\u202e", "'", "&lt;", "1,2,3", "9" * 400, "1 " * 200),
)


def mutated(rng: random.Random, text: str) -> str:
    """The text with one to three changes of attributes, elements or letters."""
    changes = (_value, _value, _value, _value, _without, _without, _twice, _letter, _swapped)
    for _ in range(rng.choice((1, 1, 2, 3))):
        text = rng.choice(changes)(rng, text)
    return text


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
