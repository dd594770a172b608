"""One motion by all means: `run`, `dae` with CVODES and IDAS, and the FMU by fmpy in both kinds."""

import casadi
import fmpy
import numpy as np

import mbs

SAME = 1e-7
"""Of the largest value: tolerances of 1e-11 in all solvers, and what accelerations magnify."""


def by_run(system, duration, v0=None, u=None, z0=None):
    return mbs.simulate.run(
        system, duration, v0=v0, u=u, z0=z0, step=duration / 10, tolerance=1e-11, quiet=True
    )


def by_dae(system, form, duration, v0=None, u=None, z0=None):
    """The state at the end, by name."""
    dae = mbs.models.dae(system, form, v0=v0, inputs=u, states=z0)
    kind = "idas" if dae.z.numel() else "cvodes"
    options = {"abstol": 1e-11, "reltol": 1e-11, "max_num_steps": 100000}
    end = casadi.integrator("end", kind, dae.casadi(), 0, duration, options)
    x = np.array(end(x0=dae.x0, z0=dae.z0, u=dae.u0, p=dae.p0)["xf"])[:, 0]
    return dict(zip([name for name, _ in dae.elements["x"]], x, strict=True))


def by_fmu(system, folder, kind, duration, v0=None, u=None, z0=None):
    path = str(mbs.export.fmu(system, folder / f"{system.name}.fmu"))
    known = [variable.name for variable in fmpy.read_model_description(path).modelVariables]
    start = {f"{name}.v": value for name, value in (v0 or {}).items()}
    columns = [name for name in by_run(system, duration).units if name in known]
    found = fmpy.simulate_fmu(
        path,
        fmi_type=kind,
        stop_time=duration,
        start_values={**start, **(u or {}), **(z0 or {})},
        output=columns,
        output_interval=duration / 200,
        relative_tolerance=1e-11,
    )
    return {name: found[name][-1] for name in columns}


def differences(found, result):
    """Of every value at the end, over the largest of it or one."""
    return {
        name: abs(value - result[name][-1]) / max(1.0, np.abs(result[name]).max())
        for name, value in found.items()
    }


def agree(system, folder, duration, shown, **start):
    """Run it in all ways; `shown` must be among the variables of the FMU."""
    result = by_run(system, duration, **start)
    for form in ("reduced", "index1"):
        found = differences(by_dae(system, form, duration, **start), result)
        assert len(found) >= system.component_states.numel() + 2
        assert max(found.values()) < SAME, (form, found)
    for kind in ("CoSimulation", "ModelExchange"):
        found = differences(by_fmu(system, folder, kind, duration, **start), result)
        assert set(shown) <= set(found)
        assert max(found.values()) < SAME, (kind, found)
    return result
