"""Certificates with the day on which their artefact was due, machines with the rule of their next calibration."""

from __future__ import annotations

from alembic import op
from sqlalchemy import Column, String, Text

from cmm_uq.laboratory.records.indexing import rebuild

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """To this revision."""
    op.add_column("certificates", Column("artefact_due", String(10)))
    op.add_column("machines", Column("calibrate", Text))
    rebuild(op.get_bind())
