"""Pictures, tables and self-contained HTML reports of results."""
