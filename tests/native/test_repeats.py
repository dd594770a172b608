import ctypes
import functools
import hashlib
import os
import subprocess
import sys
import zipfile
from collections import Counter

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.random_trees import random_tree

import mbs
from mbs.export._c_library import example_input
from mbs.native import batch, compiled, find_compiler, repeats
from mbs.native.batch_source import batch_source
from mbs.native.c_code import blocks, plain_order, slots
from mbs.native.compiler import FLAGS
from mbs.native.kernel import kernel_source
from mbs.native.repeats import Calls, recurring, with_calls
from mbs.native.scalar_source import bare_source, external_source, plain_source
from mbs.operations.graph import graph_of

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror")


def windows(count, odd=(), name="windows"):
    """Equal windows in a row, each with a condition and numbers of its own; some are unlike."""
    x, p = ca.SX.sym("x", count), ca.SX.sym("p", 2)
    state, results = p[0], []
    for k in range(count):
        a = ca.sin(x[k]) * state + (1 + 0.1 * k)
        for m in range(12):
            a = ca.if_else(a < p[1], a * x[k], a - 0.5) + 0.25 * state / ca.sqrt(1 + a * a + m)
        if k in odd:
            a = ca.sqrt(a * a + 2)
        state = a / (1 + a * a)
        results += [a * state, a - state]
    sparse = ca.SX(9, 9)
    sparse[0, 0], sparse[8, 3], sparse[8, 4] = state, results[-1], 0
    outputs = [ca.vertcat(*results), sparse, ca.vertcat(x[0], 7, p)]
    return ca.Function(name, [x, p], outputs, ["x", "p"], ["y", "S", "rest"])


def lines(function, **options):
    return plain_source([function], **options)[0].count("\n")


def library_of(source, folder):
    (folder / "f.c").write_text(source)
    command = [*find_compiler().command, *STRICT, *FLAGS, "f.c", "-o", "f.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "f.so"))


def called(code, function, work, inputs):
    pointer, w = ctypes.POINTER(ctypes.c_double), np.full(work, np.nan)
    outputs = [np.full(function.nnz_out(k), np.nan) for k in range(function.n_out())]
    arg = (pointer * len(inputs))(*(a.ctypes.data_as(pointer) for a in inputs))
    res = (pointer * len(outputs))(*(a.ctypes.data_as(pointer) for a in outputs))
    assert code(arg, res, None, w.ctypes.data_as(pointer), 0) == 0
    return outputs


def assert_bits(function, folder, inputs):
    """The C text gives the bits of the interpreted Function."""
    source, work = plain_source([function])
    assert f"{function.name()}_repeat0" in source
    code = library_of(source, folder)[function.name()]
    found = called(code, function, work.w + 1, inputs)
    wanted = function.call([ca.DM(a) for a in inputs])
    for a, b in zip(found, wanted, strict=True):
        assert a.tobytes() == np.array(b.nonzeros()).tobytes()


def inputs_of(function, seed=0):
    rng = np.random.default_rng(seed)
    return [rng.uniform(-1, 1, function.nnz_in(k)) for k in range(function.n_in())]


def test_windows_become_one_function_in_a_loop(tmp_path):
    function = windows(42)
    text = plain_source([function])[0]
    assert text.count("static NOINLINE void windows_repeat") <= 3
    assert "for (int k = 0; k < " in text
    assert "times; takes x, p; gives y" in text
    assert_bits(function, tmp_path, inputs_of(function))


def test_windows_that_differ_stay_straight_lines(tmp_path):
    function = windows(60, odd=(7, 30))
    assert_bits(function, tmp_path, inputs_of(function, 1))


def test_length_follows_what_differs_not_how_many_there_are():
    short, long = windows(42), windows(84)
    assert lines(short) < short.n_instructions() / 8
    # of a window a row of each table and its elements of outputs, not its 155 operations
    assert lines(long) - lines(short) < 42 * 8
    assert long.n_instructions() - short.n_instructions() > 42 * 100


@pytest.mark.parametrize("kind", ["fast", "exact"])
def test_other_kinds_of_code_have_them_too(kind):
    function = windows(42)
    inputs = inputs_of(function)
    wanted = [np.array(x.full()) for x in function.call([ca.DM(a) for a in inputs])]
    if kind == "exact":
        assert "windows_repeat0" in external_source([function])
        found = compiled(function, derivatives=0)(*inputs)
        for a, b in zip(found, wanted, strict=True):
            np.testing.assert_array_equal(np.ravel(a), b.ravel())
        return
    assert "windows_repeat0" in kernel_source([function])["windows.c"]
    for a, b in zip(compiled(function, derivatives=0, fast=True)(*inputs), wanted, strict=True):
        np.testing.assert_allclose(np.ravel(a), b.ravel(), rtol=1e-12, atol=1e-13)


def test_states_in_lanes():
    function = windows(40)
    given = function.sx_in()
    function = ca.Function("y", given, [function(*given)[0]], ["x", "p"], ["y"])
    rng = np.random.default_rng(2)
    x, p = rng.uniform(-1, 1, (5, 40)), rng.uniform(-1, 1, (5, 2))
    assert "y_repeat0" in batch_source(function).files["batch.c"]
    found = batch(function)(x, p)
    for k in range(5):
        wanted = function(x[k], p[k]).full().ravel()
        np.testing.assert_allclose(found[k], wanted, rtol=1e-12, atol=1e-13)


def test_single_precision_text_has_its_own_numbers():
    x = ca.SX.sym("x", 60)
    function = windows(60)
    dense = ca.Function("f", [x], [function(x, ca.DM([0.1, 0.2]))[0]])
    text, _ = bare_source([dense], "float")
    assert "static const float f_repeat0_of[]" in text
    assert "double" not in text


# What is found in a graph.


def evaluated(graph, items, inputs):
    """The values of the nodes by the steps, sequences by their own graphs."""
    values = leaves(graph, inputs)
    for item in items:
        if isinstance(item, int):
            values[item] = computed(graph, item, values)
            continue
        for k in range(item.first, item.first + item.count):
            evaluate_occurrence(item.repeat, k, values)
    return [[values[n] for n in result] for result in graph.results]


def leaves(graph, inputs):
    return {
        n: inputs[node.args[0]][node.args[1]] if node.op == ca.OP_INPUT else node.value
        for n, node in enumerate(graph.nodes)
        if node.op in (ca.OP_INPUT, ca.OP_CONST)
    }


def evaluate_occurrence(repeat, k, values):
    """Its results, by operands that are looked up as late as C does."""
    given = {t.node: t.nodes[k] for t in repeat.given}
    elsewhere = {t.node: t.nodes[k] for t in (*repeat.taken, *repeat.constants)}
    own = {n: x.value for n, x in enumerate(repeat.graph.nodes) if x.op == ca.OP_CONST}
    for n in repeat.steps:
        for a in repeat.graph.operands(n):
            if a in elsewhere:
                own[a] = values[elsewhere[a]]
        own[n] = computed(repeat.graph, n, own)
        if n in given:
            values[given[n]] = own[n]


def computed(graph, number, values):
    with np.errstate(all="ignore"):
        operands = [np.float64(values[n]) for n in graph.operands(number)]
        return FORMS[graph.nodes[number].op](*operands)


FORMS = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_NEG: lambda a: -a,
    ca.OP_TWICE: lambda a: a + a,
    ca.OP_INV: lambda a: 1 / a,
    ca.OP_SQRT: np.sqrt,
    ca.OP_LT: lambda a, b: float(a < b),
    ca.OP_LE: lambda a, b: float(a <= b),
    ca.OP_NOT: lambda a: float(not a),
    ca.OP_IF_ELSE_ZERO: lambda a, b: b if a else 0.0,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_ACOS: np.arccos,
    ca.OP_FABS: np.abs,
    ca.OP_FMIN: np.minimum,
    ca.OP_FMAX: np.maximum,
    ca.OP_SIGN: np.sign,
}


def assert_same(graph, items, inputs):
    """Every operation is done once, and has the value that it has without repeats."""
    order = plain_order(graph)
    done = Counter(n for item in items for n in ([item] if isinstance(item, int) else item.given()))
    assert max(done.values(), default=0) <= 1
    calls = [item for item in items if isinstance(item, Calls)]
    assert sum(len(c.repeat.steps) * c.count for c in calls) + sum(
        isinstance(item, int) for item in items
    ) == len(order)
    wanted = [np.array(result).tobytes() for result in evaluated(graph, order, inputs)]
    for found in (evaluated(graph, items, inputs), through_memory(graph, items, inputs)):
        assert [np.array(result).tobytes() for result in found] == wanted


def through_memory(graph, items, inputs, size=12):
    """The results where values go from block to block in the work array, as in C."""
    pieces = blocks(graph, items, size)
    where = slots(graph, pieces)
    w, results = np.full(where.count, np.nan), [[None] * len(r) for r in graph.results]
    for port, place in where.inputs.items():
        w[place : place + len(inputs[port])] = inputs[port]
    known = leaves(graph, inputs)
    for copied in where.copied.values():
        for k, element, n in copied:
            results[k][element] = known[n]
    for piece in pieces:
        local = {}
        for item in piece:
            if isinstance(item, int):
                run_step(graph, item, known, local, where, w)
                for k, element, n in where.outputs.get(item, ()):
                    results[k][element] = local[n]
                continue
            for number in range(item.first, item.first + item.count):
                run_occurrence(graph, item, number, where.tables[item.repeat], w)
    for k, element, place in where.last:
        results[k][element] = w[place]
    return results


def run_step(graph, step, known, local, where, w):
    for n in graph.operands(step):
        if n not in local:
            local[n] = known[n] if n in known else w[int(where.of[n])]
    local[step] = computed(graph, step, local)
    if step in where.of:
        w[int(where.of[step])] = local[step]


def run_occurrence(graph, calls, number, table, w):
    repeat, at = calls.repeat, table.rows[number]
    own = {n: x.value for n, x in enumerate(repeat.graph.nodes) if x.op == ca.OP_CONST}
    own |= {t.node: graph.nodes[t.nodes[number]].value for t in repeat.constants}
    given = {t.node for t in repeat.given}
    for n in repeat.steps:
        for a in repeat.graph.operands(n):
            if a not in own:
                own[a] = w[eval(table.texts[a], {"at": at})]
        own[n] = computed(repeat.graph, n, own)
        if n in given:
            w[eval(table.texts[n], {"at": at})] = own[n]


@st.composite
def graphs(draw):
    """Random operations, a part of them many times with other operands, and shuffled numbers."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    x = ca.SX.sym("x", 4)
    values = ca.vertsplit(x)
    numbers = [0.0, -0.0, 1.0, np.nextafter(1.0, 2.0), np.inf, -np.inf, np.nan, 0.1]
    recipe = [
        (int(rng.integers(6)), *map(int, rng.integers(1, 9, 2)), float(rng.choice(numbers)))
        for _ in range(draw(st.integers(20, 60)))
    ]
    for turn in range(draw(st.integers(3, 6))):
        for form, i, j, number in recipe:
            a, b = values[-min(i, len(values))], values[-min(j, len(values))]
            if rng.random() < 0.02:
                a = values[int(rng.integers(len(values)))]
            if rng.random() < 0.02:
                number = float(rng.choice(numbers))
            forms = (a + b, a - b, ca.sin(a) * b, ca.if_else(a < b, a, number))
            forms += (a * number, number - b)
            values.append(forms[form])
        values.append(values[-1] + turn)
    kept = [value for value in values if rng.random() < 0.7]
    return graph_of(ca.Function("f", [x], [ca.vertcat(*kept), ca.vertcat(*values[-8:])]))


@settings(max_examples=40, deadline=None)
@given(graphs())
def test_every_operation_is_done_once_with_the_same_value(graph):
    with pytest.MonkeyPatch.context() as patch:
        for name, value in EAGER.items():
            patch.setattr(repeats, name, value)
        items = with_calls(graph, plain_order(graph), 0)
    assert_same(graph, items, [np.random.default_rng(0).uniform(-1, 1, 4)])


EAGER = {"_SHARE": 2.0, "_ACCESSES": 9.0, "_SHORTEST": 6, "_CALL": 1, "_HEAD": 0}
"""By which every repeat is used that there is."""


def models():
    tree = random_tree(5, 14, ("revolute",)).mechanism.assemble()
    yield "tree", lambda: mbs.models.direct_dynamics(tree)
    yield "loops", lambda: mbs.models.direct_dynamics(mbs.robots.n_four_bar(24).assemble())
    yield "platform", lambda: mbs.models.direct_dynamics(catalogue_system("stewart_platform"))


@pytest.mark.parametrize("name", ["tree", "loops", "platform"])
def test_models_keep_their_values(name, monkeypatch):
    monkeypatch.setattr(repeats, "_SHARE", 2.0)
    graph = graph_of(dict(models())[name]())
    order = plain_order(graph)
    items = with_calls(graph, order, 0)
    kept = sum(isinstance(item, int) for item in items)
    # without repeats all would be kept; loops are one window after the other
    assert kept < {"tree": 0.8, "loops": 0.1, "platform": 0.9}[name] * len(order)
    rng = np.random.default_rng(3)
    assert_same(graph, items, [rng.uniform(-1, 1, p.sparsity.nnz()) for p in graph.inputs])


def test_short_graphs_and_those_without_repeats_stay_as_they_are():
    graph = graph_of(windows(20))
    order = plain_order(graph)
    assert with_calls(graph, order) == order
    rng, x = np.random.default_rng(0), ca.SX.sym("x", 5)
    values = ca.vertsplit(x)
    for _ in range(3000):
        a, b = (values[k] for k in rng.integers(max(0, len(values) - 40), len(values), 2))
        values.append((a + b, a - b, a * b, ca.sin(a), ca.sqrt(a * a + 1))[rng.integers(5)])
    graph = graph_of(ca.Function("f", [x], [ca.vertcat(*values[-40:])]))
    order = plain_order(graph)
    assert with_calls(graph, order, 0) == order


def test_numbers_that_are_nearly_equal_are_not_taken_for_each_other():
    x, numbers = ca.SX.sym("x"), [0.3] * 9
    numbers[4] = float(np.nextafter(0.3, 1.0))
    y = x
    for number in numbers:
        for _ in range(30):
            y = ca.sin(y) * number + y
    graph = graph_of(ca.Function("f", [x], [y]))
    items = with_calls(graph, plain_order(graph), 0)
    assert any(isinstance(item, Calls) for item in items)
    assert_same(graph, items, [[0.7]])


def test_recurring_sequences_are_disjoint_and_equal():
    rng = np.random.default_rng(4)
    motif = rng.integers(0, 50, 40).tolist()
    tokens = []
    for k in range(7):
        tokens += [1000 + k, *motif]
    tokens += motif * 6
    found = recurring(tokens)
    taken = [p + k for length, places in found for p in places for k in range(length)]
    assert len(taken) == len(set(taken)) >= 13 * 40
    for length, places in found:
        assert len({tuple(tokens[p : p + length]) for p in places}) == 1
        assert len(places) >= 2
    assert recurring(list(range(300))) == []


def test_places_are_free_again_after_their_last_use():
    short, long = (graph_of(windows(n)) for n in (40, 80))
    sizes = []
    for graph in (short, long):
        items = with_calls(graph, plain_order(graph))
        sizes.append(slots(graph, blocks(graph, items, 500)).count)
    # inputs, results and what a window leaves for the next one: all stay until the end of a loop
    assert sizes[1] - sizes[0] < 40 * 6


SCRIPT = """
import functools
import hashlib, sys
sys.path.insert(0, "tests/native")
from test_repeats import windows
from mbs.native.scalar_source import plain_source
print(hashlib.sha256(plain_source([windows(50)])[0].encode()).hexdigest())
"""


def test_the_text_is_the_same_in_every_process():
    environment = {**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", SCRIPT]
    other = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    own = plain_source([windows(50)])[0]
    assert other.stdout.strip() == hashlib.sha256(own.encode()).hexdigest()


# Text that leaves the package.


@pytest.mark.parametrize("real", ["double", "float"])
def test_libraries_for_processors_without_files(real, tmp_path):
    x = ca.SX.sym("x", 60)
    p = ca.SX.sym("p", 2)
    function = ca.Function("windows", [x, p], [windows(60)(x, p)[0]], ["x", "p"], ["y"])
    folder = mbs.export.c_library([function], tmp_path / "lib", target="bare", real=real)
    assert "windows_repeat0" in (folder / "lib.c").read_text()
    sources = [str(path) for path in folder.glob("*.c")]
    command = [*find_compiler().command, *STRICT, "-O1", "-ffp-contract=off", *sources]
    subprocess.run([*command, "-o", "example", "-lm"], cwd=folder, check=True)
    run = subprocess.run([folder / "example"], check=True, capture_output=True, text=True)
    found = np.array([float(word) for word in run.stdout.splitlines()[0].split()[2:]])
    inputs = [ca.DM(example_input(function, k)) for k in range(2)]
    wanted = function(*inputs).full().ravel()
    if real == "double":
        np.testing.assert_array_equal(found, wanted)
    else:  # 2^-24 of each of some ten operations of a window, carried on by the next ones
        np.testing.assert_allclose(found, wanted, atol=1e-4)


@pytest.mark.sweep
def test_an_fmu_moves_as_without_repeats(tmp_path, monkeypatch):
    system = mbs.robots.n_four_bar(4).assemble()
    ends = []
    for least in (0, sys.maxsize):
        monkeypatch.setattr(repeats, "_SHARE", 2.0)
        calls = functools.partial(_from, least)
        monkeypatch.setattr("mbs.native.scalar_source.with_calls", calls)
        path = mbs.export.fmu(system, tmp_path / f"fmu{len(ends)}.fmu")
        with zipfile.ZipFile(path) as archive:
            text = archive.read("sources/model.c").decode()
        assert ("operations, done" in text) == (least == 0)
        result = mbs.simulate.fmu(path, 0.2, step=0.05, quiet=True)
        ends.append(np.concatenate([np.asarray(result[name]) for name in ("a0.q", "a0.v")]))
    np.testing.assert_array_equal(*ends)


def _from(least, graph, steps, _):
    return with_calls(graph, steps, least)
