"""The FMUs that several files of tests look at, each made once."""

import dataclasses
import functools

import pytest
from fmu_instances import Fmu, Fmu3
from fmu_models import MODELS

from mbs.export.fmu.pack import write_fmu


@pytest.fixture(scope="session")
def fmu_of(tmp_path_factory):
    """The FMU of a model of `fmu_models`, by its name."""

    @functools.cache
    def make(name, fmi="2.0", solver="dopri5"):
        folder = tmp_path_factory.mktemp(name)
        model = dataclasses.replace(MODELS[name](), solver=solver)
        path = write_fmu(model, folder / f"{name}.fmu", fmi=fmi)
        return (Fmu if fmi == "2.0" else Fmu3)(path, folder / "unpacked")

    return make


@pytest.fixture(params=["pendulum", "slider_crank", "clapper"])
def fmu(fmu_of, request):
    return fmu_of(request.param)


@pytest.fixture
def crank(fmu_of):
    return fmu_of("slider_crank")


@pytest.fixture
def swing(fmu_of):
    return fmu_of("pendulum")
