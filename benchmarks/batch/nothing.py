"""A process that answers at once, with nothing: what is left is the scheduling."""

from __future__ import annotations

from cmm_uq.laboratory.schedule.processes import serve

if __name__ == "__main__":
    serve(lambda setting: lambda number, task: None)
