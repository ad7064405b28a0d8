"""numpy arrays whose axes have names, and whose places on an axis may have names, too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np


class LabelledArray:
    """An array with a name for each axis, and names of the places on some of them.

    numpy takes it wherever it takes an array; `values` is the array itself.
    """

    def __init__(self, values: np.ndarray, axes: Sequence[str], labels: Mapping[str, Sequence[str]] = {}):
        if values.ndim != len(axes):
            raise ValueError(f"an array of shape {values.shape} has not the axes {tuple(axes)}")
        for axis, names in labels.items():
            if axis in axes and len(names) != values.shape[list(axes).index(axis)]:
                raise ValueError(f"axis {axis} has not {len(names)} places")
        self.values = values
        self.axes = tuple(axes)
        self.labels = {axis: tuple(names) for axis, names in labels.items() if axis in axes}

    @property
    def shape(self) -> tuple[int, ...]:
        return self.values.shape

    @property
    def sizes(self) -> dict[str, int]:
        """The length of each axis by its name."""
        return dict(zip(self.axes, self.values.shape))

    def sel(self, **places: str | int | slice) -> LabelledArray | np.floating:
        """The part at a place of one axis or more: `sel(band="R", row=3)`. A place is a label, an index or a slice."""
        index: list[int | slice] = [slice(None)] * self.values.ndim
        for axis, place in places.items():
            if axis not in self.axes:
                raise KeyError(f"no axis {axis!r}; there are {', '.join(self.axes)}")
            if isinstance(place, str):
                names = self.labels.get(axis, ())
                if place not in names:
                    raise KeyError(f"axis {axis} has no {place!r}; it has {', '.join(names) or 'no names'}")
                place = names.index(place)
            index[self.axes.index(axis)] = place
        axes = [axis for axis, place in zip(self.axes, index) if isinstance(place, slice)]
        part = self.values[tuple(index)]
        if not axes:
            return part
        labels = {a: names[index[self.axes.index(a)]] for a, names in self.labels.items() if a in axes}
        return LabelledArray(part, axes, labels)

    def to_xarray(self):
        """The same as an `xarray.DataArray` (xarray is no dependency)."""
        import xarray

        coordinates = {axis: list(names) for axis, names in self.labels.items()}
        return xarray.DataArray(np.asarray(self.values), dims=self.axes, coords=coordinates)

    def __array__(self, dtype=None, copy=None):
        values = np.asarray(self.values, dtype=dtype)
        return values.copy() if copy else values

    def __getitem__(self, index):
        return self.values[index]

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        return f"LabelledArray({', '.join(f'{a}: {n}' for a, n in self.sizes.items())})"
