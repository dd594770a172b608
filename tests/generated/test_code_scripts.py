"""Octave, Python and Rust texts, run here, against the Functions they came from."""

import shutil
import subprocess

import numpy as np
import pytest
from code_models import NAMES, assert_close, example, expected, states

import mbs


def literal(value):
    """A matrix as Octave reads it."""
    rows = (" ".join(repr(float(x)) for x in row) for row in np.atleast_2d(value))
    return f"reshape([{'; '.join(rows)}], {value.shape[0]}, {value.shape[1]})"


def compare_printed(text):
    """Lines `name state output numbers...`, matrices column by column, with the Functions."""
    printed = {tuple(row[:3]): row[3:] for row in map(str.split, text.splitlines()) if row}
    for name in NAMES:
        function = example(name)
        for j, values in enumerate(states(function)):
            for k, want in enumerate(expected(function, values)):
                numbers = [float(x) for x in printed[name, str(j), str(k)]]
                assert_close(np.array(numbers), want.ravel(order="F"))


@pytest.mark.skipif(not shutil.which("octave"), reason="Octave is not installed")
def test_octave_text_runs(tmp_path):
    script = []
    for name in NAMES:
        function = example(name)
        mbs.export.code(example(name), "octave", tmp_path / f"{name}.m", name)
        outputs = [f"o{k}" for k in range(function.n_out())]
        for j, values in enumerate(states(function)):
            script.append(f"[{', '.join(outputs)}] = {name}({', '.join(map(literal, values))});")
            for k, out in enumerate(outputs):
                rows, columns = function.size_out(k)
                script.append(f"assert(all(size({out}) == [{rows}, {columns}]));")
                script.append(f"printf('{name} {j} {k}'); printf(' %.17g', {out}); printf('\\n');")
    (tmp_path / "run_all.m").write_text("\n".join(script))
    command = ["octave", "--no-gui", "--norc", "--quiet", "run_all.m"]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr[:2000]
    compare_printed(answer.stdout)


def rust_main():
    """A program that prints the outputs of every function at every state."""
    lines = ["fn main() {"]
    for name in NAMES:
        function = example(name)
        for j, values in enumerate(states(function)):
            arrays = [", ".join(repr(float(x)) for x in v.ravel(order="F")) for v in values]
            inputs = [f"&[{array}]" for array in arrays]
            lines.append("    {")
            for k in range(function.n_out()):
                lines.append(f"        let mut o{k} = [f64::NAN; {function.numel_out(k)}];")
            outputs = [f"&mut o{k}" for k in range(function.n_out())]
            lines.append(f"        {name}({', '.join([*inputs, *outputs])});")
            for k in range(function.n_out()):
                lines.append(f'        print!("{name} {j} {k}");')
                lines.append(f'        for x in o{k}.iter() {{ print!(" {{:e}}", x); }}')
                lines.append("        println!();")
            lines.append("    }")
    return "\n".join([*lines, "}"])


@pytest.mark.skipif(not shutil.which("rustc"), reason="no Rust compiler")
def test_rust_text_runs(tmp_path):
    texts = [mbs.export.code(example(name), "rust", name=name) for name in NAMES]
    (tmp_path / "main.rs").write_text("\n".join([*texts, rust_main()]))
    command = ["rustc", "-D", "warnings", "--edition", "2021", "main.rs"]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr[:3000]
    run = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True)
    compare_printed(run.stdout)


def python_function(name, function):
    space = {}
    exec(mbs.export.code(example(name), "python", name=name), space)
    return space[name if name in space else f"{name}_"]


def flat(function, k, value):
    """An input as Python takes it: a number, a vector or a matrix."""
    if value.shape[1] > 1:
        return value
    known = getattr(function, "elements", lambda _: ())(function.name_in(k))
    return value[:, 0] if len(value) > 1 or known else value.item()


@pytest.mark.parametrize("name", NAMES)
def test_python_text_runs(name):
    function = example(name)
    ours = python_function(name, function)
    for values in states(function):
        outputs = ours(*(flat(function, k, value) for k, value in enumerate(values)))
        outputs = outputs if isinstance(outputs, tuple) else (outputs,)
        for out, want in zip(outputs, expected(function, values), strict=True):
            assert_close(np.reshape(out, want.shape), want)


@pytest.mark.parametrize("name", ["puma_idm", "puma_T", "choices", "stanford_energy"])
def test_python_takes_many_states_at_once(name):
    function = example(name)
    many = states(function, 4)
    columns = [np.concatenate(some, axis=1) for some in zip(*many, strict=True)]
    outputs = python_function(name, function)(*columns)
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    for j, values in enumerate(many):
        for out, want in zip(outputs, expected(function, values), strict=True):
            assert_close(out[..., j].reshape(want.shape), want)
