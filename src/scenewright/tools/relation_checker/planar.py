"""Shapely without its missing types: one name, so that the rest of the package stays strict."""

from __future__ import annotations

from typing import Any

import shapely
import shapely.ops

geos: Any = shapely
"""The module shapely."""

Area = Any
"""A shapely geometry."""
