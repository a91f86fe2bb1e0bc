"""Bokeh's models as plain records, and the JSON that its JavaScript draws them from.

Bokeh's own Python classes look at every property of every model several times: two seconds for a page that
takes a tenth of that this way. ``tests/hil/reports/test_plot_models.py`` has Bokeh read the pages.
"""

from __future__ import annotations

import gzip
import math
import sys
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

DASHES = {"solid": [], "dashed": [6], "dotted": [2, 4]}
"""Lengths of dashes and gaps in pixels, by Bokeh's names."""

_COMPRESSION = 6


class Model:
    """A model by its name in Bokeh, with those of its attributes that differ from the defaults there."""

    __slots__ = ("attributes", "kind")

    def __init__(self, kind: str, **attributes: Any) -> None:
        self.kind = kind
        self.attributes = attributes

    def set(self, **attributes: Any) -> None:
        """Give it other attributes, or other values of those it has."""
        self.attributes |= attributes


@dataclass(frozen=True, slots=True)
class Field:
    """What a glyph takes from a column of its data, for every point another."""

    name: str


@dataclass(frozen=True, slots=True)
class Value:
    """What a glyph takes for all points alike, where it could take a column."""

    value: Any


class Figure(Model):
    """A plot. ``height`` [px]; every axis has a label, and a grid."""

    __slots__ = ("grids", "height", "x_axis", "y_axis")

    def __init__(
        self, *, height: int, x_range: Model, y_range: Model, x_label: str, y_label: str, **attributes: Any
    ) -> None:
        self.height = height
        self.x_axis, self.y_axis = _axis(x_range, x_label), _axis(y_range, y_label)
        self.grids = [Model("Grid", axis=self.x_axis), Model("Grid", axis=self.y_axis, dimension=1)]
        scales = {
            f"{name}_scale": Model("CategoricalScale")
            for name, its_range in (("x", x_range), ("y", y_range))
            if its_range.kind == "FactorRange"
        }
        # What refers to others comes after them.
        super().__init__(
            "Figure",
            height=height,
            x_range=x_range,
            y_range=y_range,
            **scales,
            renderers=[],
            toolbar=Model("Toolbar", tools=[], logo=None, active_drag=None, active_scroll=None),
            left=[self.y_axis],
            below=[self.x_axis],
            center=list(self.grids),
            title=None,
            **attributes,
        )

    def add_glyph(self, data: Model, glyph: Model) -> Model:
        """Draw columns of data; gives the renderer, which a tool may be bound to."""
        renderer = Model("GlyphRenderer", data_source=data, glyph=glyph)
        self.attributes["renderers"].append(renderer)
        return renderer

    def make_logarithmic(self) -> None:
        """Give it a logarithmic y axis."""
        self.y_axis.kind = "LogAxis"
        self.set(y_scale=Model("LogScale"))

    def add_tools(self, *tools: Model) -> None:
        """Give the reader more tools."""
        self.attributes["toolbar"].attributes["tools"].extend(tools)

    def add_layout(self, annotation: Model) -> None:
        """Put a line or an area over the plot."""
        self.attributes["center"].append(annotation)


def source_of(data: Mapping[str, Any]) -> Model:
    """Data of glyphs: lists and arrays by the names of their columns."""
    return Model("ColumnDataSource", data=data)


def bokeh_script() -> str:
    """Bokeh's JavaScript, as it is installed."""
    spec = find_spec("bokeh")
    folders = spec.submodule_search_locations if spec else None
    if not folders:
        raise ModuleNotFoundError("No module named 'bokeh'", name="bokeh")
    script = Path(folders[0]) / "server" / "static" / "js" / "bokeh.min.js"
    return script.read_text(encoding="utf-8")


def document_of(roots: Sequence[Model]) -> tuple[dict[str, Any], list[str]]:
    """Roots as a document in Bokeh's JSON, and the numbers that they have in it."""
    numbers: dict[Model, str] = {}
    document = {
        "version": version("bokeh"),
        "title": "abreast",
        "config": _plain(Model("DocumentConfig"), numbers),
        "roots": [_plain(root, numbers) for root in roots],
    }
    return document, [numbers[root] for root in roots]


def _axis(its_range: Model, label: str) -> Model:
    kind = "CategoricalAxis" if its_range.kind == "FactorRange" else "LinearAxis"
    return Model(kind, axis_label=label)


def _plain(value: Any, numbers: dict[Model, str]) -> Any:
    """A value as what JSON has; a model that was told before by its number alone."""
    if isinstance(value, Model):
        if known := numbers.get(value):
            return {"id": known}
        numbers[value] = number = f"p{len(numbers)}"
        told = {name: _plain(each, numbers) for name, each in value.attributes.items()}
        return {"type": "object", "name": value.kind, "id": number, "attributes": told}
    if isinstance(value, Field):
        return {"type": "field", "field": value.name}
    if isinstance(value, Value):
        return {"type": "value", "value": value.value}
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, Mapping):
        return {"type": "map", "entries": [[name, _plain(each, numbers)] for name, each in value.items()]}
    if isinstance(value, (list, tuple)):
        return [_plain(each, numbers) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return {"type": "number", "value": "nan" if math.isnan(value) else f"{value:+}"}
    return value


def _array(values: NDArray[Any]) -> dict[str, Any]:
    packed = gzip.compress(values.tobytes(), _COMPRESSION, mtime=0)
    held = {"type": "bytes", "data": b64encode(packed).decode()}
    return {
        "type": "ndarray",
        "array": held,
        "shape": list(values.shape),
        "dtype": values.dtype.name,
        "order": sys.byteorder,
    }
