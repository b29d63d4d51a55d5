"""Edits in the display units; files and evidence stay in SI."""

from collections.abc import Callable

from msgspec.structs import replace

from gateway.units import Unit, Units
from server_gui.core.evidence.comparison import Measured
from server_gui.core.evidence.experiment import Experiment, Point, Response
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.tuning.edits import unit_of

Si = Callable[[str], str | None]  # the SI unit of a parameter, None where it is not known


def in_units(told: EditEvidence, units: Units, si: Si) -> EditEvidence:
    """Return the same, its values, metrics and responses in these units; curves stay SI.

    A value whose unit is not known stays as it was told.
    """
    changes = tuple(
        replace(one, old=_scaled(one.old, unit), new=one.new * unit.scale)
        for one in told.edit.changes
        for unit in (_unit(one.name, units, si),)
    )
    metrics = tuple(_measured(one, units) for one in told.evidence.metrics)
    tried = told.experiment
    return replace(
        told,
        edit=replace(told.edit, changes=changes),
        evidence=replace(told.evidence, metrics=metrics),
        experiment=None if tried is None else _experiment(tried, units),
    )


def symbols(told: EditEvidence, units: Units, si: Si) -> dict[str, str]:
    """Return the symbol of each parameter's unit, empty where it has none or it is not known."""
    return {one.name: _unit(one.name, units, si).symbol for one in told.edit.changes}


def _unit(name: str, units: Units, si: Si) -> Unit:
    found = si(name)
    return Unit("", "") if found is None else unit_of(name, found, units)


def _scaled(value: float | None, unit: Unit) -> float | None:
    return None if value is None else value * unit.scale


def _measured(one: Measured, units: Units) -> Measured:
    unit = units.unit(one.series.rpartition(".")[2], one.unit)
    names = ("before", "after", "difference", "low", "high")
    return replace(one, unit=unit.symbol, **{name: _scaled(getattr(one, name), unit) for name in names})


def _experiment(one: Experiment, units: Units) -> Experiment:
    unit = unit_of(one.parameter, one.unit, units)
    return replace(
        one,
        unit=unit.symbol,
        original=one.original * unit.scale,
        values=tuple(value * unit.scale for value in one.values),
        periods=tuple(replace(period, value=period.value * unit.scale) for period in one.periods),
        responses=tuple(_response(response, unit, units) for response in one.responses),
        proposal=_scaled(one.proposal, unit),
    )


def _response(one: Response, across: Unit, units: Units) -> Response:
    up = units.unit(one.series.rpartition(".")[2], one.unit)

    def point(each: Point) -> Point:
        mean, low, high = (value * up.scale for value in (each.mean, each.low, each.high))
        return replace(each, value=each.value * across.scale, mean=mean, low=low, high=high)

    return replace(one, unit=up.symbol, points=tuple(map(point, one.points)))
