"""Unpacked FMUs and what tests do with their instances."""

import ctypes
import math
import struct
import zlib

import fmpy
import numpy as np
import pytest
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.logging import addLoggerProxy

SOLVERS = pytest.mark.parametrize("solver", ["dopri5", "rodas", "rk4"])
TIGHT = 1e-11


_LOGGER = fmi2.fmi2CallbackLoggerTYPE(fmi2.printLogMessage)


def _kept_callbacks():
    """fmpy's, with a logger that lives: its proxy calls that of the last who asked."""
    callbacks = fmi2.fmi2CallbackFunctions(
        logger=_LOGGER,
        allocateMemory=fmi2.defaultCallbacks.allocateMemory,
        freeMemory=fmi2.defaultCallbacks.freeMemory,
    )
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


def values(instance, description, names):
    """Values of variables of any type, in the order of the names."""
    variables, found = {v.name: v for v in description.modelVariables}, []
    for variable in (variables[name] for name in names):
        get = getattr(instance, f"get{variable.type}")
        if description.fmiVersion == "2.0":
            found += get([variable.valueReference])
        else:
            size = math.prod(variable.shape or ())
            found += get([variable.valueReference], nValues=size)
    return np.array(found, dtype=float)


class Fmu:
    """An unpacked FMU of FMI 2.0 and its instances."""

    def __init__(self, path, folder):
        self.path = path
        self.folder = fmpy.extract(str(path), str(folder))
        self.description = fmpy.read_model_description(self.folder)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}

    def open(self, kind, upto="run", start=None, tolerance=None, guid=None, callbacks=None):
        instance = kind(
            guid=guid or self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="instance",
        )
        instance.instantiate(callbacks=callbacks or _kept_callbacks())
        self.prepare(instance, upto, start, tolerance)
        return instance

    def prepare(self, instance, upto="run", start=None, tolerance=None):
        self.set(instance, start or {})
        if upto == "instantiated":
            return
        instance.setupExperiment(startTime=0.0, tolerance=tolerance)
        instance.enterInitializationMode()
        if upto == "initialization":
            return
        instance.exitInitializationMode()
        if isinstance(instance, FMU2Model) and upto == "run":
            instance.newDiscreteStates()
            instance.enterContinuousTimeMode()

    def get(self, instance, *names):
        return values(instance, self.description, names)

    def set(self, instance, values):
        instance.setReal([self.references[n] for n in values], list(values.values()))

    def step(self, instance, steps, h=0.01, begin=0.0):
        rows = []
        names = [v.name for v in self.description.modelVariables if v.causality == "output"]
        for k in range(steps):
            instance.doStep(begin + k * h, h)
            rows.append(self.get(instance, *names))
        return np.array(rows)


class Fmu3:
    """An unpacked FMU of FMI 3.0 and its instances."""

    def __init__(self, path, folder):
        self.path, self.folder = path, fmpy.extract(str(path), str(folder))
        self.description = fmpy.read_model_description(self.folder)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}

    def unborn(self, kind, token=None):
        return kind(
            guid=token or self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="instance",
        )

    def open(self, kind, token=None):
        instance = self.unborn(kind, token)
        instance.instantiate()
        return instance

    def running(self, kind):
        instance = self.open(kind)
        instance.enterInitializationMode(tolerance=1e-9)
        instance.exitInitializationMode()
        if kind is FMU3Model:
            instance.updateDiscreteStates()
            instance.enterContinuousTimeMode()
        return instance

    def names(self, unknowns):
        return [u.variable.name for u in unknowns]

    def get(self, instance, names):
        return values(instance, self.description, names)


def refused(call, *arguments):
    with pytest.raises(FMICallException):
        call(*arguments)


def signed(state):
    """Bytes of a state with the checksum that belongs to them."""
    struct.pack_into("=I", state, 0, zlib.crc32(state[4:]))
    return bytes(state)


def slave(fmu, events=True, early=True, update=None):
    instance = fmu.unborn(FMU3Slave)
    instance.instantiate(eventModeUsed=events, earlyReturnAllowed=early, intermediateUpdate=update)
    instance.enterInitializationMode(tolerance=TIGHT)
    instance.exitInitializationMode()
    if events:
        instance.updateDiscreteStates()
        instance.enterStepMode()
    return instance


def slopes(instance, fmu, **orders):
    """Derivatives of one input: order to value."""
    name, values = next(iter(orders.items()))
    instance.setRealInputDerivatives(
        [fmu.references[name]] * len(values), list(values), list(values.values())
    )
