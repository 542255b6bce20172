"""Where a recording and its model differ, and what was left out of the model."""
