import numpy as np
import pytest
from support.plain_arms import apart, manseur_doty, puma

from mbs.models.inverse_geometry.numeric import core
from mbs.models.inverse_geometry.numeric.general import general, general_of
from mbs.models.inverse_geometry.numeric.merge import merged
from mbs.models.inverse_geometry.numeric.nearest import nearest
from mbs.models.inverse_geometry.numeric.polish import polish
from mbs.models.inverse_geometry.numeric.search import search
from mbs.native import compiler_found


@pytest.fixture
def no_compiler(monkeypatch):
    monkeypatch.setattr(core, "compiler_found", lambda: False)
    assert core.core() is None


@pytest.mark.skipif(not compiler_found(), reason="no C compiler")
def test_the_core_is_loaded_once():
    assert core.core() is core.core() is not None


@pytest.mark.usefixtures("no_compiler")
def test_all_works_where_there_is_no_compiler():
    arm, T = manseur_doty()
    q = general(general_of(arm), T)
    assert len(q) == 16
    assert np.max(polish(arm, T, q + 1e-6).residual) < 1e-14
    assert len(merged(arm, T, np.concatenate([q, q + 1e-9])).q) == 16
    found = search(puma(), puma().pose(np.full(6, 0.5)))
    assert len(found) == 8
    assert np.min(apart(puma(), found, np.full((1, 6), 0.5))) < 1e-12
    T[:3, 3] += 10
    assert nearest(arm, T).distance > 5
