"""Maple, Mathematica, Julia, LaTeX and classic texts, read back and evaluated line by line."""

import ast
import math
import re

import numpy as np
import pytest
import sympy
from code_models import NAMES, assert_close, example, expected, states
from sympy.parsing.mathematica import parse_mathematica
from sympy.parsing.sympy_parser import parse_expr

import mbs

SHORT = ("puma_idm", "puma_T", "slider_idm", "choices", "operations", "sparse", "awkward")


def choose(condition, value, otherwise):
    return value if condition else otherwise


def zeros(rows, columns):
    return [[0.0] * int(columns)] * int(rows)


SHARED = {
    "Integer": float,
    "Float": float,
    "piecewise": choose,
    "signum": sympy.sign,
    "arctan": lambda *x: sympy.atan2(*x) if len(x) == 2 else sympy.atan(*x),
    **{f"arc{n}": getattr(sympy, f"a{n}") for n in ("sin", "cos", "sinh", "cosh", "tanh")},
    "ln": sympy.log,
    "abs": sympy.Abs,
    "ceil": sympy.ceiling,
    "min": sympy.Min,
    "max": sympy.Max,
    "Vector": list,
    "Matrix": lambda *x: x[0] if len(x) == 1 else zeros(*x),
    "zeros": zeros,
    "trunc": math.trunc,
    "rem": math.fmod,
    "log1p": lambda x: sympy.log(1 + x),
    "expm1": lambda x: sympy.exp(x) - 1,
    "hypot": lambda x, y: sympy.sqrt(x * x + y * y),
}


class Arrays(dict):
    """Elements of inputs, by `name[row, column]` counted from 1."""

    def __init__(self, names, values):
        super().__init__(zip(names, values, strict=True))

    def element(self, name, place):
        rows = [int(k) - 1 for k in place.split(",")]
        value = self[name]
        return float(value[rows[0], rows[1] if len(rows) > 1 else 0])


def evaluate(statements, arrays, read):
    """The value of every name once all `name, expression` are computed in turn."""
    known = {name: float(v.item()) for name, v in arrays.items() if v.size == 1}
    for name, text in statements:
        load = re.fullmatch(r"(\w+)\[+([\d, ]+)\]+", text)
        known[name] = arrays.element(*load.groups()) if load else read(text, known)
    return known


def number(value):
    return float(value) if not isinstance(value, (list, tuple)) else [number(x) for x in value]


def read_sympy(text, known):
    return number(parse_expr(text, local_dict={**SHARED, **known}))


def check(name, results):
    """Outputs by a function of values."""
    function = example(name)
    for values in states(function, 2):
        for ours, want in zip(results(values), expected(function, values), strict=True):
            assert_close(np.reshape(np.array(ours, dtype=float), want.shape), want)


def joined(text):
    """The text without comments, its line breaks blanks."""
    text = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
    return " ".join(re.sub(r"#.*", "", text).split())


@pytest.mark.parametrize("name", SHORT)
def test_maple(name):
    text = joined(mbs.export.code(example(name), "maple", name=name))
    head, body = re.fullmatch(rf"{name} := proc\((.*?)\) local .*?; (.*) end proc:", text).groups()
    *statements, last, end = body.split(";")
    assert end.strip() == ""
    outputs = last.removeprefix(" return ").split(", ")
    pairs = [s.strip().split(" := ") for s in statements]

    def read(text, known):
        text = re.sub(r"(?<![<>=!])=(?!=)", "==", text.replace("<>", "!=").replace("^", "**"))
        return read_sympy(text, known)

    def results(values):
        known = evaluate(pairs, Arrays(head.split(", "), values), read)
        return [known[out] for out in outputs]

    check(name, results)


@pytest.mark.parametrize("name", SHORT)
def test_mathematica(name):
    text = joined(mbs.export.code(example(name), "mathematica", name=name))
    title, head, body = re.fullmatch(r"(\w+)\[(.*?)\] := Module\[\{.*?\}, (.*) \]", text).groups()
    assert title == re.sub(r"_(\w)", lambda m: m[1].upper(), name)
    *statements, last = body.split(";")
    names = [argument.removesuffix("_") for argument in head.split(", ")]
    assert not any("_" in argument for argument in names)
    pairs = [s.strip().split(" = ", 1) for s in statements]

    def read(text, known):
        values = {sympy.Symbol(key): value for key, value in known.items()}

        def denied(match):  # sympy does not read it
            return "(1 < 0)" if parse_mathematica(match[1]).xreplace(values) else "(0 < 1)"

        text = re.sub(r"Not\[([^\[\]]*)\]", denied, text)
        parsed = parse_mathematica(re.sub(r"([\d.]+)\*\^(-?\d+)", r"(\1*10.0^(\2))", text))
        return value_of(parsed, values)

    def results(values):
        known = evaluate(pairs, Arrays(names, values), read)
        listing = last.translate(str.maketrans("{}", "[]"))
        result = ast.literal_eval(re.sub(r"[A-Za-z]\w*", lambda m: repr(known[m[0]]), listing))
        return [result] if example(name).n_out() == 1 else result

    check(name, results)


def value_of(parsed, known):
    """The number that an expression of Mathematica is."""
    parsed = parsed.xreplace(known)
    for name, function in UNKNOWN.items():
        parsed = parsed.replace(sympy.Function(name), function)
    return float(parsed)


UNKNOWN = {
    "Abs": sympy.Abs,
    "Floor": sympy.floor,
    "Ceiling": sympy.ceiling,
    "IntegerPart": lambda x: sympy.sign(x) * sympy.floor(sympy.Abs(x)),
    "Equal": lambda a, b: sympy.true if a == b else sympy.false,
    "Unequal": lambda a, b: sympy.true if a != b else sympy.false,
    "If": choose,
}


@pytest.mark.parametrize("name", [*SHORT, "stanford_A", "four_bar_ddm"])
def test_julia(name):
    text = mbs.export.code(example(name), "julia", name=name)
    code = [re.sub(r"#.*", "", line) for line in text.splitlines()]
    lines = re.sub(r"(?<=[-+*/,&|<>=(]) *\n\s*", " ", "\n".join(code)).splitlines()
    lines = [line.strip() for line in lines if line.strip()]
    head = re.fullmatch(rf"function {name}\((.*)\)", lines[0])[1].split(", ")
    assert lines[-1] == "end"
    outputs = lines[-2].removeprefix("return ").split(", ")
    body = re.sub(r"\[\n((?:.*\n)*?)\]", rows_of_julia, "\n".join(lines[1:-2]))
    pairs = [line.split(" = ", 1) for line in body.splitlines()]

    def read(text, known):
        text = re.sub(r"^\((.*)\) \? (.*) : (.*)$", r"piecewise(\1, \2, \3)", text)
        text = text.replace("&&", " and ").replace("||", " or ").replace("!(", "not (")
        special = {"atan": SHARED["arctan"], "ifelse": choose, "isnan": math.isnan}
        return read_sympy(text.replace("^", "**"), {**special, **known})

    def results(values):
        known = evaluate(pairs, Arrays(head, values), read)
        return [known[out] for out in outputs]

    check(name, results)


def rows_of_julia(match):
    rows = (", ".join(row.split()) for row in match[1].strip().splitlines())
    return f"[{', '.join(f'[{row}]' for row in rows)}]"


CLASSIC = {"Piecewise": lambda *pairs: next(v for v, c in pairs if c), "Abs": sympy.Abs}


@pytest.mark.parametrize("name", ["puma_idm", "slider_idm", "choices", "operations"])
def test_classic_text(name):
    function = example(name)
    text = mbs.export.code(example(name), "symoro", name=name)
    assert text.endswith(";\n*=*\n")
    equations = " ".join(text.partition("Equations:\n")[2].removesuffix("*=*\n").split())
    pairs = [s.strip().split(" = ") for s in equations.split(";") if s.strip()]

    def results(values):
        known = known_elements(function, values)
        for key, expression in pairs:
            known[key] = read_sympy(expression, {**CLASSIC, **known})
        out = function.name_out(0).replace("tau", "GAM")
        return [[known[f"{out}{k + 1}"] for k in range(function.numel_out(0))]]

    check(name, results)


PREFIX = {"v": "QP", "a": "QDP", "tau": "GAM"}


def known_elements(function, values):
    """Elements of inputs by their names."""
    known = {}
    for label, value in zip(function.name_in(), values, strict=True):
        names = [n for n, _ in getattr(function, "elements", lambda _: [])(label)]
        names = names or [f"{label}{k + 1}" if value.size > 1 else label for k in range(value.size)]
        if label in PREFIX:
            names = [PREFIX[label] + n.removeprefix("q") for n in names]
        known |= dict(zip(names, map(float, value[:, 0]), strict=True))
    return known


# ---- LaTeX ----


def from_latex(text):
    """An expression of LaTeX as Python writes it; what stays of LaTeX makes it unreadable."""
    text = re.sub(r"\\ddot\{q\}_\{(\w+)\}", r"QDP\1", text)
    text = re.sub(r"\\dot\{q\}_\{(\w+)\}", r"QP\1", text)
    text = re.sub(r"\\Gamma_\{(\w+)\}", r"GAM\1", text)
    text = re.sub(r"\\mathit\{(\w+)\}", r"\1", text)
    text = re.sub(r"(\w)_\{(\w+)\}", r"\1\2", text)
    text = re.sub(r"\\left\(|\\right\)", lambda m: m[0][-1], text)
    text = re.sub(r"\\(sin|cos|tanh)\{(\(.*?\))\}", r"\1\2", text)
    text = re.sub(r"\\operatorname\{sgn\}", "sign", text)
    text = re.sub(r"\^\{([^{}]*)\}", r"**(\1)", text)
    while (once := re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", r"((\1)/(\2))", text)) != text:
        text = once
    return text.replace(r"\,", "*").replace(r"\cdot", "*")


@pytest.mark.parametrize("name", ["puma_idm", "slider_idm"])
def test_latex(name):
    function = example(name)
    text = mbs.export.code(example(name), "latex", name=name)
    body = re.search(r"\\begin\{document\}(.*)\\end\{document\}", text, re.DOTALL)[1]
    equations = []
    for block in re.findall(r"\\begin\{align\*\}\n(.*?)\n\\end\{align\*\}", body, re.DOTALL):
        equations += re.sub(r" \\\\\n&\\quad\{\}", "", block).split(" \\\\\n")

    def results(values):
        known = known_elements(function, values)
        for equation in equations:
            left, right = equation.split(" &= ")
            known[from_latex(left)] = read_sympy(from_latex(right), known)
        return [[known[f"GAM{k + 1}"] for k in range(function.numel_out(0))]]

    check(name, results)


@pytest.mark.parametrize("name", NAMES)
def test_latex_brackets_match(name):
    text = mbs.export.code(example(name), "latex", name=name)
    for line in re.split(r" \\\\\n", text):
        assert line.count(r"\left") == line.count(r"\right")
        assert line.count("{") == line.count("}")
    for case in re.findall(r"\\begin\{cases\}(.*?)\\end\{cases\}", text, re.DOTALL):
        assert (case.count("&"), case.count(r"\\")) == (2, 1)
    for word in ("document", "align*", "cases"):
        assert text.count(rf"\begin{{{word}}}") == text.count(rf"\end{{{word}}}")
    assert text.isascii()
