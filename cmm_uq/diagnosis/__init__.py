"""Where a recording and its model differ: screening before anything is fitted, and outliers after."""
