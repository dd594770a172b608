"""A readable account of an identification."""

from __future__ import annotations

from mbs.identification.bodies.physical_set import consistent_links
from mbs.identification.estimation.essential import Essential
from mbs.identification.estimation.estimate import Estimate
from mbs.identification.estimation.residuals import Residuals
from mbs.identification.observations.observations import Observations
from mbs.identification.observations.quality import excitation_quality
from mbs.identification.regressors.columns import INERTIAL

_POOR = 30.0
_SURE = 3.0
_UNFIT = 20.0
"""Error of all efforts that noise and friction laws do not explain [%]."""


def report(estimate: Estimate, *tests: tuple[str, Residuals]) -> str:
    """Parameters with their deviations, errors of every joint, and what the record shows.

    Args:
        estimate: by any method.
        *tests: further errors with a title each, such as ("last quarter", held_out(...)).

    Returns:
        lines of text; a * marks parameters whose deviation is more than 30 %.
    """
    observations = estimate.observations
    rows, m = observations.y.shape
    span = observations.time[-1] - observations.time[0]
    lines = [
        f"Identification by {estimate.method}: {len(estimate.names)} parameters from"
        f" {rows} instants of {m} efforts, {span:.4g} s",
        "",
        *_parameters(estimate),
        "",
        *_residuals("Errors", estimate.residuals),
    ]
    for title, residuals in tests:
        lines += ["", *_residuals(f"Errors, {title}", residuals)]
    remarks = [
        *_fit(estimate.residuals),
        *_dropped(observations),
        *_excitation(estimate),
        *_consistency(estimate),
        *_signs(estimate),
    ]
    return "\n".join([*lines, "", *remarks])


def identification_report(
    estimate: Estimate, essential: Essential, bodies: Estimate | str, *tests: tuple[str, Residuals]
) -> str:
    """The account of base parameters, the essential ones among them, and bodies.

    Args:
        estimate: of base parameters.
        essential: the same in the parameters that the record needs.
        bodies: a full set, or why there is none.
        *tests: further errors of the base parameters with a title each.
    """
    few = essential.estimate
    lines = [
        f"Essential: {len(few.names)} of {len(estimate.names)} parameters, errors with them alone"
        f" {few.residuals.total_percent:.2f} %; {essential.reason}",
        f"Not needed: {', '.join(essential.dropped) or 'none'}",
    ]
    told = bodies if isinstance(bodies, str) else report(bodies)
    return "\n".join([report(estimate, *tests), "", *lines, "", told])


def _parameters(estimate: Estimate) -> list[str]:
    lines = [f"{'parameter':<12}{'value':>12}{'deviation':>12}{'%':>9}  unit"]
    rows = zip(
        estimate.columns, estimate.values, estimate.deviations, estimate.percent, strict=True
    )
    for column, value, deviation, percent in rows:
        share = f"{percent:.1f}" if percent < 1000 else "-"
        mark = " *" if percent > _POOR else ""
        lines.append(
            f"{column.name:<12}{value:>12.5g}{deviation:>12.2g}{share:>9}  {column.unit}{mark}"
        )
    return lines


def _residuals(title: str, residuals: Residuals) -> list[str]:
    lines = [
        f"{title}: {residuals.total_percent:.2f} % of all efforts",
        f"{'effort':<12}{'error':>10}{'rms':>12}  {'unit':<6}{'independent rows':>18}",
    ]
    rows = zip(
        residuals.efforts,
        residuals.percent,
        residuals.rms,
        residuals.effort_units,
        len(residuals.time) / residuals.repetition,
        strict=True,
    )
    return lines + [
        f"{name:<12}{percent:>8.2f} %{rms:>12.4g}  {unit:<6}{count:>18.0f}"
        for name, percent, rms, unit, count in rows
    ]


def _fit(residuals: Residuals) -> list[str]:
    """Errors that no noise explains."""
    if not residuals.total_percent > _UNFIT:
        return []
    return [
        f"Fit: {residuals.total_percent:.0f} % of the efforts are not explained; check the order of"
        " the columns, units (rad, N m), gear ratios (joint_side) and signs"
    ]


def _dropped(observations: Observations) -> list[str]:
    if not observations.dropped:
        return []
    rows = len(observations.time)
    return [
        f"Loops: {observations.dropped} of {rows + observations.dropped} instants are left out,"
        " where the motion is next to a singular posture or passes it"
    ]


def _excitation(estimate: Estimate) -> list[str]:
    """What the record does not show; of a full set, some parameters never can be told apart."""
    if _is_full(estimate):
        return []
    quality = excitation_quality(estimate.observations)
    if quality.sentence:
        return [f"Excitation: {quality.sentence}"]
    return [
        f"Excitation: condition number {quality.condition:.4g}, {quality.scaled_condition:.4g}"
        " with scaled columns"
    ]


def _consistency(estimate: Estimate) -> list[str]:
    """Whether bodies can have the parameters, where all ten of every link are there."""
    if not _is_full(estimate):
        return []
    links = {c.link for c in estimate.columns if c.kind in INERTIAL}
    good = consistent_links(estimate.columns, estimate.values)
    bad = [str(link) for link in sorted(links) if link not in good]
    if not bad:
        return [f"Bodies: all {len(good)} pseudo-inertias are positive definite"]
    return [f"Bodies: no body has the parameters of link {', '.join(bad)}"]


def _is_full(estimate: Estimate) -> bool:
    """Whether all ten parameters of every link are there."""
    inertial = [c for c in estimate.columns if c.kind in INERTIAL]
    return len(inertial) == len(INERTIAL) * len({c.link for c in inertial}) > 0


def _signs(estimate: Estimate) -> list[str]:
    """Friction and rotors that are surely negative, which no robot has."""
    rows = zip(estimate.columns, estimate.values, estimate.deviations, strict=True)
    kinds = ("Ia", "Iam", "Jm", "Fv", "Fvm", "Fs", "Fsm")
    bad = [c.name for c, x, s in rows if c.kind in kinds and x < -_SURE * s]
    if not bad:
        return []
    return [f"Below zero: {', '.join(bad)}; check the signs of the efforts and the friction law"]
