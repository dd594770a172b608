import io
import subprocess
import sys

from mbs import progress as module


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown(monkeypatch, *, patience, terminal, quiet=False):
    stream = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(module, "PATIENCE", patience)
    with module.progress("swinging", 0.0, 10.0, quiet=quiet) as reach:
        for time in range(11):
            reach(float(time))
    return stream.getvalue()


def test_long_runs_show_a_bar(monkeypatch):
    assert "swinging" in shown(monkeypatch, patience=0.0, terminal=True)


def test_short_quiet_and_piped_runs_show_nothing(monkeypatch):
    assert not shown(monkeypatch, patience=2.0, terminal=True)
    assert not shown(monkeypatch, patience=0.0, terminal=False)
    assert not shown(monkeypatch, patience=0.0, terminal=True, quiet=True)


def test_nothing_heavy_is_imported_early():
    code = "import mbs.simulate, mbs.result, mbs.native, mbs.solvers, sys; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    loaded = set(answer.stdout.split())
    assert "casadi" in loaded
    assert not loaded & {"fmpy", "rich", "matplotlib", "pandas", "sympy"}


def test_a_listener_hears_label_and_part_of_quiet_runs_and_only_within_its_block():
    heard = []
    with module.listen(lambda label, part: heard.append((label, part))):
        with module.progress("swinging", 2.0, 12.0, quiet=True) as reach:
            for time in (2.0, 7.0, 13.0):
                reach(time)
        with module.progress("nothing", 1.0, 1.0, quiet=True) as reach:
            reach(1.0)
    with module.progress("later", 0.0, 1.0, quiet=True) as reach:
        reach(0.5)
    assert heard == [("swinging", 0.0), ("swinging", 0.5), ("swinging", 1.0), ("nothing", 1.0)]


def test_an_error_in_a_listened_block_ends_the_listening():
    heard = []
    try:
        with module.listen(lambda *told: heard.append(told)):
            raise RuntimeError("stop")
    except RuntimeError:
        pass
    with module.progress("later", 0.0, 1.0, quiet=True) as reach:
        reach(0.5)
    assert heard == []
