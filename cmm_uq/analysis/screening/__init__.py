"""What a recording shows before anything is fitted: damaged rows, exchanged points, gross outliers after."""
