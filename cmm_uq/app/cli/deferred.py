"""Parts of scipy that are loaded when something of them is first used: commands that hardly compute need none of them.

They are half the time that such a command takes to start; the standard library's lazy loader puts them off.
"""

from __future__ import annotations

import sys
from importlib.util import LazyLoader, find_spec, module_from_spec

PARTS = ("scipy.linalg", "scipy.special", "scipy.optimize", "scipy.sparse", "scipy.spatial")


def defer_scipy() -> None:
    """Have each part loaded by its first use, unless it is loaded already."""
    import scipy

    for name in PARTS:
        spec = None if name in sys.modules else find_spec(name)
        if spec is None or spec.loader is None:
            continue
        spec.loader = LazyLoader(spec.loader)
        module = module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        setattr(scipy, name.rpartition(".")[2], module)
