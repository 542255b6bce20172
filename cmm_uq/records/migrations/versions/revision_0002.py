"""Certificates with the day on which their artefact was due: it may have been calibrated again since."""

from __future__ import annotations

from alembic import op
from sqlalchemy import Column, String

from cmm_uq.records.verifying import rebuild

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """To this revision."""
    op.add_column("certificates", Column("artefact_due", String(10)))
    rebuild(op.get_bind())
