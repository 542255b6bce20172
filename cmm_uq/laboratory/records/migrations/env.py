"""Run by Alembic: the revisions, on the connection that it was given."""

from __future__ import annotations

from alembic import context

from cmm_uq.laboratory.records.tables import META

context.configure(
    connection=context.config.attributes["connection"], target_metadata=META, transactional_ddl=False,
    render_as_batch=True, compare_type=True,
)  # fmt: skip
context.run_migrations()
