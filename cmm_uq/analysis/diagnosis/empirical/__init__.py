"""The unknown as a model: functions that no effect accounts for, their form where it can be told."""
