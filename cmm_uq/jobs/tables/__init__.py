"""What job.toml may say, table by table, each checked by itself."""
